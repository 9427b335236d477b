"""The ego vehicle: its response to pedal commands, and how it keeps its lane.

Longitudinal: drive-by-wire with a dead time, pedals scaled to accelerations (paper, section ACC), a first-order lag and
a limited jerk while the brakes build up pressure, and tyres that share μ·g between braking and cornering (friction
circle). It neither rolls backwards nor slows down by itself: with both pedals at 0 it holds its speed. Lateral: a
driver who follows the lane, within the grip of the tyres.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, exp, sqrt

from pipeline.common.fast_replace import evolve
from pipeline.simulation.world.actors import Motion

GRAVITY_MPS2 = 9.81
_LANE_STIFFNESS_PER_S2, _LANE_DAMPING_PER_S = 2.0, 2.8
"""A critically damped return to the lane within about two seconds."""
_MAX_DRIFT_RAD = 0.3


@dataclass(frozen=True)
class Pedals:
    """0–1 each, as in ``AccCommand``."""

    accelerator: float = 0.0
    """1 is full throttle."""
    brake: float = 0.0
    """1 is full braking."""


@dataclass(frozen=True)
class VehicleModel:
    """A passenger car on a dry road. The lags are first order."""

    full_accel_mps2: float = 2.0
    """Acceleration at accelerator 1; the scale that ``AccParams`` assumes."""
    full_brake_mps2: float = 8.0
    """Deceleration at brake 1; the scale that ``AccParams`` assumes."""
    dead_time_s: float = 0.1
    """Delay from the command to the first change at the wheels."""
    drive_lag_s: float = 0.3
    """Time constant of the engine."""
    brake_lag_s: float = 0.08
    """Time constant of the brakes."""
    drive_jerk_mps3: float = 5.0
    """Maximum rate of change of the engine's acceleration."""
    brake_jerk_mps3: float = 25.0
    """Rate of brake pressure build-up: 0 to 8 m/s² in 0.32 s."""
    friction: float = 0.9
    """μ of tyre on road."""


@dataclass(frozen=True)
class VehicleState:
    """The ego vehicle at one moment."""

    t_s: float
    """Since the scenario's start."""
    travelled_m: float
    """Distance driven since time 0."""
    speed_mps: float
    """Longitudinal speed."""
    accel_mps2: float
    """Longitudinal acceleration."""
    d_m: float
    """Offset to the left of the road's reference line."""
    d_rate_mps: float = 0.0
    """Rate of change of ``d_m``."""
    d_accel_mps2: float = 0.0
    """Rate of change of ``d_rate_mps``."""
    pedals: Pedals = Pedals()
    """The active command."""
    pending: tuple[tuple[float, Pedals], ...] = ()
    """(activation time, pedals) of pending commands, oldest first."""

    def motion(self) -> Motion:
        """In the form used by the world."""
        return self.motion_at(self.t_s)

    def motion_at(self, t_s: float) -> Motion:
        """The same a moment earlier or later, at constant acceleration down to standstill."""
        after_s = t_s - self.t_s
        if self.accel_mps2 < 0.0:
            after_s = min(after_s, self.speed_mps / -self.accel_mps2)
        speed_mps = self.speed_mps + self.accel_mps2 * after_s
        return Motion(
            self.travelled_m + (self.speed_mps + speed_mps) / 2.0 * after_s,
            self.d_m + (self.d_rate_mps + self.d_accel_mps2 * after_s / 2.0) * after_s,
            speed_mps,
            self.accel_mps2,
            self.d_rate_mps + self.d_accel_mps2 * after_s,
            self.d_accel_mps2,
        )


def command(state: VehicleState, pedals: Pedals, model: VehicleModel) -> VehicleState:
    """Send a pedal command; it takes effect after the dead time."""
    return evolve(state, pending=(*state.pending, (state.t_s + model.dead_time_s, pedals)))


def advance(
    state: VehicleState, lane: Motion, curvature_per_m: float, dt_s: float, model: VehicleModel
) -> VehicleState:
    """The vehicle ``dt_s`` later. lane: the driver's target motion, of which only d and its derivatives are used.
    curvature_per_m: of the road here. dt_s should be a few milliseconds."""
    state = _receive(state)
    wanted = _pedal_accel(state.pedals, model)
    braking = wanted < 0.0 or state.accel_mps2 < 0.0
    lag_s, jerk = (model.brake_lag_s, model.brake_jerk_mps3) if braking else (model.drive_lag_s, model.drive_jerk_mps3)
    change = (wanted - state.accel_mps2) * (1.0 - exp(-dt_s / lag_s))
    grip = model.friction * GRAVITY_MPS2
    d_accel = _steer(state, lane, grip)
    cornering = state.speed_mps**2 * curvature_per_m + d_accel
    along = sqrt(max(grip**2 - cornering**2, 0.0))
    accel = _clip(state.accel_mps2 + _clip(change, jerk * dt_s), along)
    return _move(state, accel, d_accel, dt_s)


def _receive(state: VehicleState) -> VehicleState:
    """Activates the newest command that has arrived."""
    arrived = [pedals for time_s, pedals in state.pending if time_s <= state.t_s]
    if not arrived:
        return state
    return evolve(state, pedals=arrived[-1], pending=state.pending[len(arrived) :])


def _pedal_accel(pedals: Pedals, model: VehicleModel) -> float:
    """Pedal scaling: the brake wins over the accelerator."""
    if pedals.brake > 0.0:
        return -min(pedals.brake, 1.0) * model.full_brake_mps2
    return min(max(pedals.accelerator, 0.0), 1.0) * model.full_accel_mps2


def _steer(state: VehicleState, lane: Motion, grip_mps2: float) -> float:
    """Lateral acceleration towards the lane's course, limited by the tyres' grip; zero at standstill."""
    if state.speed_mps <= 0.0:
        return 0.0
    wanted = (
        lane.d_accel_mps2
        + _LANE_DAMPING_PER_S * (lane.d_rate_mps - state.d_rate_mps)
        + _LANE_STIFFNESS_PER_S2 * (lane.d_m - state.d_m)
    )
    return _clip(wanted, grip_mps2)


def _move(state: VehicleState, accel: float, d_accel: float, dt_s: float) -> VehicleState:
    """Exact for constant acceleration; handles standstill within the step."""
    speed = state.speed_mps + accel * dt_s
    if speed <= 0.0 and accel <= 0.0:
        moving_s = state.speed_mps / -accel if accel < 0.0 else 0.0
        travelled, speed = state.travelled_m + state.speed_mps * moving_s / 2, 0.0
    else:
        travelled = state.travelled_m + (state.speed_mps + speed) / 2 * dt_s
    d_rate = _clip(state.d_rate_mps + d_accel * dt_s, _MAX_DRIFT_RAD * speed)
    return evolve(
        state,
        t_s=state.t_s + dt_s,
        travelled_m=travelled,
        speed_mps=speed,
        accel_mps2=accel if speed > 0.0 else min(accel, 0.0),
        d_m=state.d_m + d_rate * dt_s,
        d_rate_mps=d_rate,
        d_accel_mps2=d_accel,
    )


def _clip(value: float, limit: float) -> float:
    return copysign(min(abs(value), limit), value)
