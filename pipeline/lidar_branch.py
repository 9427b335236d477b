"""The part of a frame's work that needs no network: own motion, and the LiDAR's objects.

It takes a third to two thirds of the processor time of ``pipeline.step``. Networks take longer, so it runs beside them
(``pipeline.run.advance``), and only the rest of the step is left to do when their outputs are there.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from pipeline.common.clips import begins_clip
from pipeline.common.kalman import Transition
from pipeline.common.stopwatch import Stopwatch
from pipeline.ego_motion import coasting, frame_change, own_motion
from pipeline.lidar import segmentation
from pipeline.lidar import tracking as lidar_tracking
from pipeline.params import MotionParams, Params, Section
from pipeline.path import yaw_rate
from pipeline.types import EgoState, Frame, Ground, LidarTrack, Moment

_LATE_MS = 50.0
"""Half of the time between two sweeps."""


class Before(Protocol):
    """The parts of the previous frame's state that this branch needs (``pipeline.step.State``)."""

    @property
    def t_ns(self) -> int | None:
        """Time of the last frame; None before the first."""
        ...

    @property
    def lidar(self) -> lidar_tracking.LidarTrackerState:
        """Tracks of the LiDAR's clusters."""
        ...

    @property
    def own(self) -> EgoState | None:
        """Ego motion of the last frame; None while unknown."""
        ...

    @property
    def measured(self) -> own_motion.OwnMotionState:
        """Odometry and GNSS courses of earlier frames."""
        ...

    @property
    def ground(self) -> Ground | None:
        """Ground of the last sweep."""
        ...


class LidarBranch(NamedTuple):
    """What is known of a frame without its image."""

    motion: own_motion.Measured
    """Own motion, as measured."""
    now: Moment
    """The frame's time, and own motion as stages use it."""
    sweep: segmentation.SegmentedSweep
    """The sweep, segmented into obstacles and ground."""
    tracker: lidar_tracking.LidarTrackerState
    """For the next frame."""
    tracks: tuple[LidarTrack, ...]
    """The obstacles, tracked from sweep to sweep."""
    timing_ms: dict[str, float]
    """Milliseconds by stage."""
    params: Params
    """The parameters used."""


def follow(before: Before, frame: Frame, params: Params, earlier: LidarBranch | None = None) -> LidarBranch:
    """Own motion and LiDAR objects of a frame.

    earlier: the result for the same frame after the same state, with other parameters. What those parameters do not
    change is taken from it.
    """
    dt_s = _since(before.t_ns, frame, params)
    last = before.own if dt_s is not None else None
    clock = Stopwatch()
    if earlier is not None and _motion_sections(params) == _motion_sections(earlier.params):
        if _lidar_sections(params) == _lidar_sections(earlier.params):
            return earlier._replace(params=params, timing_ms=dict.fromkeys(earlier.timing_ms, 0.0))
        motion, now = earlier.motion, earlier.now
    else:
        motion = _measure_motion(before, frame, dt_s, params)
        moved = coasting.follow(last, motion.ego, dt_s, params.motion)
        now = Moment(frame.t_ns, dt_s, moved, coasting.recent(moved, params.motion))
    clock.lap("own_motion")

    # Objects on the ground in this sweep, tracked from sweep to sweep
    tracker = before.lidar if dt_s is not None else lidar_tracking.LidarTrackerState()
    road = before.ground if dt_s is not None else None
    sweep = segmentation.segment(frame.sweep, now.ego, params, clock, tracker, dt_s, road)
    change = _frame_change(last, now, params.motion)
    tracker, tracks = lidar_tracking.track(tracker, sweep.obstacles, dt_s, params.lidar_tracking, change)
    clock.lap("lidar_tracking")
    timing_ms = clock.timing_ms()
    del timing_ms["total"]
    return LidarBranch(motion, now, sweep, tracker, tracks, timing_ms, params)


def _frame_change(last: EgoState | None, now: Moment, params: MotionParams) -> Transition | None:
    """How relative motion has changed since the last frame, whose own motion was ``last``."""
    before = coasting.recent(last, params) if params.keep_over_ground else None
    return frame_change.between(before, now.ego, now.dt_s)


def _motion_sections(params: Params) -> tuple[Section, ...]:
    """The parameters that own motion depends on."""
    return params.motion, params.time


def _lidar_sections(params: Params) -> tuple[Section, ...]:
    """The parameters that the LiDAR's objects depend on, besides own motion."""
    return params.deskew, params.downsample, params.ground, params.cluster, params.box, params.lidar_tracking


def _measure_motion(before: Before, frame: Frame, dt_s: float | None, params: Params) -> own_motion.Measured:
    """Own motion in a frame, from all available sources."""
    seen = own_motion.OdometryContext(before.ground, before.lidar.tracks, coasting.recent(before.own, params.motion))
    earlier = before.measured if dt_s is not None else own_motion.OwnMotionState()
    clock = Stopwatch()
    found = own_motion.measure(earlier, frame, yaw_rate.believable(frame.ego), seen, dt_s, params.motion)
    late_ms = clock.timing_ms()["total"]
    if frame.streams and late_ms > _LATE_MS:  # live sensors only: a recording's results must not depend on the clock
        return found._replace(notes=(*found.notes, f"LiDAR odometry took {late_ms:.0f} ms"))
    return found


def _since(t_ns: int | None, frame: Frame, params: Params) -> float | None:
    """Seconds since the previous frame, at ``t_ns``; None at the start, after a gap and after a jump back in time."""
    if t_ns is None or begins_clip(t_ns, frame.t_ns, params.time.reset_gap_s):
        return None
    return (frame.t_ns - t_ns) / 1e9
