"""Selects the sources of ego motion: the most certain one for speed, and for yaw rate.

The vehicle bus and an inertial unit are most certain and cost no computing time. A GNSS receiver gives a good speed,
and a yaw rate that lags. The LiDAR gives both in about ten milliseconds per sweep; it is used where speed or yaw rate
is missing or comes from GNSS. Contradictions between sources are reported."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi
from typing import NamedTuple

from pipeline.common.fast_replace import evolve
from pipeline.ego_motion import from_gnss, lidar_odometry
from pipeline.ego_motion.from_gnss import Courses
from pipeline.ego_motion.lidar_odometry import LidarMotion, OdometryState
from pipeline.params import MotionParams
from pipeline.types import (
    EgoState,
    Frame,
    Ground,
    LidarTrack,
    MotionEstimate,
    MotionSource,
    OwnMotion,
)

_CONTRADICT_SIGMAS, _CONTRADICT_MPS = 5.0, 1.0
"""Speeds that differ by more than both contradict each other."""
_CONTRADICT_RADPS = 3.0 * pi / 180.0
"""The same for yaw rates."""
_VAGUE_MPS, _VAGUE_RADPS = 1.0, 2.0 * pi / 180.0
"""Own motion with a larger sigma is not used: 1 m/s does not distinguish a standing car from a creeping one, and 2°/s
at 10 m/s shift the path at 30 m by 1.6 m, half a lane."""
_SPEED_SIGMA_MPS: dict[MotionSource, tuple[float, float]] = {"can": (0.1, 0.01), "ins": (0.05, 0.0), "gnss": (0.2, 0.0)}
"""For each source: a constant part, and a share of the speed (tyre wear changes the radius by 1 %)."""
_YAW_RATE_SIGMA_RADPS: dict[MotionSource, float] = {"can": 0.005, "ins": 0.002, "gnss": 1.0 * pi / 180.0}
"""The car's own sensor as measured in comma2k19; for a receiver, the slope of courses that are accurate to 0.2°."""
_NAMES: dict[str, str] = {"can": "CAN", "ins": "IMU", "gnss": "GNSS", "lidar": "LiDAR"}
"""For people."""


@dataclass(frozen=True)
class OwnMotionState:
    """State from one frame to the next."""

    odometry: OdometryState = OdometryState()
    """State of LiDAR odometry; empty while it is not used."""
    courses: Courses = ()
    """Courses of the last GNSS fixes."""


class OdometryContext(NamedTuple):
    """The previous frame's data that odometry needs."""

    ground: Ground | None
    """Its road."""
    tracks: tuple[LidarTrack, ...]
    """Its LiDAR tracks."""
    motion: EgoState | None
    """Its own motion, measured or predicted."""


class Measured(NamedTuple):
    """Own motion of one frame."""

    state: OwnMotionState
    """For the next frame."""
    ego: EgoState | None
    """Speed and yaw rate; None if nothing measures them."""
    own: OwnMotion | None
    """The sources of own motion."""
    notes: tuple[str, ...]
    """Problems, as sentences."""


def measure(
    before: OwnMotionState,
    frame: Frame,
    recorded: EgoState | None,
    seen: OdometryContext,
    dt_s: float | None,
    params: MotionParams,
) -> Measured:
    """Own motion in a frame.

    Args:
        before: state after the previous frame.
        frame: its sweep and GNSS fix are used.
        recorded: the frame's own motion, if plausible.
        seen: the previous frame's surroundings.
        dt_s: seconds since the previous frame; None at the start and after a gap.
        params: ``source`` restricts the sources.
    """
    if params.source == "off":
        return Measured(OwnMotionState(), None, None, ())
    # Measurements of the car and its receiver
    courses, received = before.courses, None
    if frame.gnss is not None and (recorded is None or recorded.source != "gnss"):
        courses, received = from_gnss.follow(courses, frame.gnss)
    given = [each for each in (recorded, received) if each is not None]
    # LiDAR odometry, if these are not sufficient
    odometry, placed, note = OdometryState(), None, ""
    if _asks_the_lidar(params, given):
        prior = seen.motion if seen.motion is not None else recorded
        odometry, placed, note = lidar_odometry.follow(
            before.odometry, frame.sweep, seen.ground, seen.tracks, dt_s, prior if params.source == "auto" else None
        )
    sources = [_usual(each) for each in given] + ([_of_lidar(placed)] if placed is not None else [])
    state = OwnMotionState(odometry, courses)
    notes = (note,) if note and (params.source == "lidar" or not given) else ()
    trusted = [each for each in map(_as_far_as_usable, sources) if each is not None and _may(each.source, params)]
    if recorded is not None and received is not None and params.source == "auto":
        trusted = [each for each in trusted if each.source != "gnss"]  # as accurate as the car's own, but delayed
    if not trusted:
        return Measured(state, None, None, (*notes, *_nothing_of(params.source, sources)))
    # Speed and yaw rate are each taken from the most certain source
    speed = min(trusted, key=lambda each: each.speed_sigma_mps)
    turns = [each for each in trusted if each.yaw_rate_sigma_radps is not None]
    turning = min(turns, key=lambda each: each.yaw_rate_sigma_radps or 0.0) if turns else None
    own = OwnMotion(speed, turning, tuple(sources), placed.pose if placed is not None else None)
    return Measured(state, _as_ego(own, frame, recorded), own, (*notes, *_contradictions(own)))


def _asks_the_lidar(params: MotionParams, given: list[EgoState]) -> bool:
    if params.source == "lidar":
        return True
    return params.source == "auto" and all(each.source == "gnss" or each.yaw_rate_radps is None for each in given)


def _may(source: MotionSource, params: MotionParams) -> bool:
    """Whether this source is permitted."""
    if params.source == "can":
        return source in ("can", "ins")
    return params.source in ("auto", source)


def _usual(ego: EgoState) -> MotionEstimate:
    """The recorded own motion, with the usual uncertainty of such sensors."""
    constant, share = _SPEED_SIGMA_MPS[ego.source]
    turning = None if ego.yaw_rate_radps is None else _YAW_RATE_SIGMA_RADPS[ego.source]
    return MotionEstimate(
        ego.source, ego.speed_mps, hypot(constant, share * ego.speed_mps), ego.yaw_rate_radps, turning
    )


def _of_lidar(placed: LidarMotion) -> MotionEstimate:
    return MotionEstimate(
        "lidar", placed.speed_mps, placed.speed_sigma_mps, placed.yaw_rate_radps, placed.yaw_rate_sigma_radps
    )


def _as_far_as_usable(each: MotionEstimate) -> MotionEstimate | None:
    """The estimate without values that are too uncertain: a bad yaw rate bends the path more than none."""
    if each.speed_sigma_mps > _VAGUE_MPS:
        return None
    if each.yaw_rate_sigma_radps is not None and each.yaw_rate_sigma_radps > _VAGUE_RADPS:
        return evolve(each, yaw_rate_radps=None, yaw_rate_sigma_radps=None)
    return each


def _as_ego(own: OwnMotion, frame: Frame, recorded: EgoState | None) -> EgoState:
    """Own motion for the stages. The recorded value is unchanged unless another source adds to it."""
    turning = own.turning
    if recorded is not None and own.speed.source == recorded.source:
        if turning is None or turning.source == recorded.source:
            return recorded
        return evolve(recorded, yaw_rate_radps=turning.yaw_rate_radps, yaw_rate_sigma_radps=_beyond_usual(turning))
    return EgoState(
        frame.t_ns,
        own.speed.speed_mps,
        turning.yaw_rate_radps if turning is not None else None,
        source=own.speed.source,
        yaw_rate_sigma_radps=_beyond_usual(turning) if turning is not None else None,
    )


def _beyond_usual(turning: MotionEstimate) -> float | None:
    """The sigma of the LiDAR's yaw rate; that of other sensors is part of ``path.yaw_rate_sigma_radps``."""
    return turning.yaw_rate_sigma_radps if turning.source == "lidar" else None


def _nothing_of(wanted: str, sources: list[MotionEstimate]) -> tuple[str, ...]:
    """A sentence if the requested source delivers nothing but others do."""
    others = [_NAMES[each.source] for each in sources]
    if wanted not in ("can", "gnss") or not others:
        return ()
    return (f"ego motion: no data from {_NAMES[wanted]}; {' and '.join(others)} available but not used",)


def _contradictions(own: OwnMotion) -> tuple[str, ...]:
    """A sentence for each source whose speed or yaw rate contradicts the chosen one."""
    found, chosen = list[str](), own.speed
    for each in own.sources:
        apart = abs(each.speed_mps - chosen.speed_mps)
        allowed = max(_CONTRADICT_SIGMAS * hypot(each.speed_sigma_mps, chosen.speed_sigma_mps), _CONTRADICT_MPS)
        if each is not chosen and apart > allowed:
            found.append(
                f"ego speed: {_NAMES[chosen.source]} {chosen.speed_mps * 3.6:.0f} km/h, "
                f"{_NAMES[each.source]} {each.speed_mps * 3.6:.0f} km/h"
            )
        found += _turns_otherwise(own.turning, each)
    return tuple(found)


def _turns_otherwise(chosen: MotionEstimate | None, each: MotionEstimate) -> list[str]:
    """A sentence if the yaw rate of another source contradicts the chosen one. Not for a receiver, because of its
    lag."""
    if chosen is None or chosen.yaw_rate_radps is None or each.yaw_rate_radps is None:
        return []
    if "gnss" in (chosen.source, each.source):
        return []
    sigma_radps = hypot(chosen.yaw_rate_sigma_radps or 0.0, each.yaw_rate_sigma_radps or 0.0)
    if abs(each.yaw_rate_radps - chosen.yaw_rate_radps) <= max(_CONTRADICT_SIGMAS * sigma_radps, _CONTRADICT_RADPS):
        return []
    return [
        f"yaw rate: {_NAMES[chosen.source]} {chosen.yaw_rate_radps * 180.0 / pi:+.0f}°/s, "
        f"{_NAMES[each.source]} {each.yaw_rate_radps * 180.0 / pi:+.0f}°/s"
    ]
