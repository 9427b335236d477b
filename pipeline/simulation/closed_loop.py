"""The closed loop: the world as the sensors see it → the pipeline → pedals → the vehicle → the next world.

    world_state.at ─► SensorRig ─► boxes (truth or network) ─► step ─► AccCommand ─► vehicle, in 5 ms steps ─┐
       └────────────────────────────────────────────────────────────────────────────────────────────────────◄┘

Deterministic: the same scenario, parameters and seed give the same drive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from pipeline.common.fast_replace import evolve
from pipeline.detection import Detectors, detect
from pipeline.params import Params
from pipeline.run import Sensors as Sensed
from pipeline.run import only
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.sensors.rig import Exposure, SensorRig
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.world import actors, world_state
from pipeline.simulation.world import ego_vehicle as vehicle
from pipeline.simulation.world.ego_vehicle import Pedals, VehicleModel, VehicleState
from pipeline.simulation.world.world_state import World
from pipeline.step import State, step
from pipeline.types import AccCommand, Frame, Result
from pipeline.vision.detector import Detector
from pipeline.vision.far_view import FarView
from pipeline.warm_up import warm_up

STEP_S = 0.005


class Eyes(Protocol):
    """Detects vehicles in the image."""

    @property
    def needs_image(self) -> bool: ...

    def look(self, frame: Frame, seen: Exposure, seed: int) -> Frame:
        """The frame with ``raw_boxes``. seen: what its image shows."""
        ...


@dataclass(frozen=True)
class TruthEyes:
    """Projected truth with a detector's errors: no image, no network."""

    noise: BoxNoise = BoxNoise()
    """The detector's errors."""
    needs_image: bool = False
    """No image is drawn."""

    def look(self, frame: Frame, seen: Exposure, seed: int) -> Frame:
        return evolve(frame, raw_boxes=truth_boxes.boxes(*seen, self.noise, seed, frame.index))


@dataclass(frozen=True)
class NetworkEyes:
    """A real network on the rendered image."""

    detector: Detector
    """Runs on the whole image."""
    far: FarView | None = None
    """Runs on the far part of the image; None to use only the whole image."""
    needs_image: bool = True
    """The image is drawn for it."""

    def look(self, frame: Frame, seen: Exposure, seed: int) -> Frame:
        return detect(frame, Detectors(self.detector, far=self.far))


@dataclass(frozen=True)
class Setup:
    """The setup of a drive."""

    params: Params = field(default_factory=Params)
    """Parameters of the pipeline."""
    sensors: Sensed = "both"
    """Sensors available to the pipeline."""
    eyes: Eyes = TruthEyes()
    """How vehicles in the image are detected."""
    model: VehicleModel = VehicleModel()
    """How the car responds to pedals."""
    closed: bool = True
    """Whether the pipeline's pedals move the car; otherwise it follows its script, and commands are only recorded."""


@dataclass(frozen=True)
class LoopStep:
    """One tick of a drive."""

    index: int
    """From 0."""
    world: World
    """The truth when the sensors measured."""
    frame: Frame
    """What the sensors measured."""
    result: Result
    """Result of the pipeline."""
    vehicle: VehicleState
    """State of the vehicle when the sensors measured."""

    @property
    def t_s(self) -> float:
        return self.world.t_s


def drive(scenario: Scenario, setup: Setup) -> Iterator[LoopStep]:
    """Every tick of the scenario, until its end or until the caller stops."""
    warm_up()
    period_s = 1.0 / scenario.rate_hz
    sensors, senses = SensorRig(scenario, _furthest_m(scenario)), Senses(scenario)
    car = _at_start(scenario)
    state = State()
    for index in range(scenario.frame_count()):
        t_s = index * period_s
        if not setup.closed:
            car = _scripted(scenario, t_s)
        now = world_state.at(scenario, t_s, car.motion())
        frame = _look(sensors, senses, setup, car, now, index)
        state, result = step(state, frame, setup.params)
        yield LoopStep(index, now, frame, result, car)
        if setup.closed:
            car = _drive_on(vehicle.command(car, _pedals(result.acc), setup.model), scenario, period_s, setup.model)


def _look(sensors: SensorRig, senses: Senses, setup: Setup, car: VehicleState, now: World, index: int) -> Frame:
    """What the car's sensors deliver, with the scenario's faults, and what is detected in it."""
    seen = senses.exposure(now, index, sensors.camera, car.motion_at) if setup.sensors != "lidar" else None
    wants_image = seen is not None and setup.eyes.needs_image
    frame = sensors.frame(now, index, round(now.t_s * 1e9), image=wants_image, exposure=seen)
    if frame.sweep is not None:
        frame = evolve(frame, sweep=senses.disturbed(frame.sweep, index))
    if seen is not None:
        frame = setup.eyes.look(frame, seen, senses.seed)
    return only(frame, setup.sensors)


def _pedals(command: AccCommand | None) -> Pedals:
    return Pedals() if command is None else Pedals(command.accelerator, command.brake)


def _drive_on(car: VehicleState, scenario: Scenario, seconds: float, model: VehicleModel) -> VehicleState:
    """The dynamics from one tick to the next."""
    steps = max(1, round(seconds / STEP_S))
    curvature = scenario.road.curvature_per_m(scenario.ego.start_m + car.travelled_m)
    for _ in range(steps):
        lane = actors.motion(scenario.ego, scenario.road, car.t_s)
        car = vehicle.advance(car, lane, curvature, seconds / steps, model)
    return car


def _at_start(scenario: Scenario) -> VehicleState:
    return _scripted(scenario, 0.0)


def _scripted(scenario: Scenario, t_s: float) -> VehicleState:
    own = scenario.own_motion(t_s)
    return VehicleState(t_s, own.travelled_m, own.speed_mps, own.accel_mps2, own.d_m, own.d_rate_mps, own.d_accel_mps2)


def _furthest_m(scenario: Scenario) -> float:
    """A position on the road that the car cannot reach: 1.2 times its fastest scripted speed, for the whole
    duration."""
    return scenario.ego.start_m + 1.2 * max(scenario.ego.speed_mps.values()) * scenario.duration_s
