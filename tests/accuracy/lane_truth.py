"""How far tracked lane lines are from the painted ones in the simulator, where the truth is known to the millimetre.

The whole line runs on drawn images and LiDAR sweeps; what is judged is the ego lane that it hands to the corridor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.geometry import F64
from pipeline.detection import Detectors, Detects
from pipeline.params import Params
from pipeline.run import advance
from pipeline.simulation import scenario
from pipeline.simulation.drawing.road_markings import edge_paint_m
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.world_state import World
from pipeline.step import State
from pipeline.types import RawLanes
from pipeline.types.lane import EgoLane, LaneLine

AHEAD_M = (10.0, 20.0, 30.0)
_BEHIND_M, _BEYOND_M, _STEP_M = 10.0, 60.0, 0.5
_NEAR_M = 0.4


@dataclass(frozen=True)
class LaneError:
    """One line at one distance in one frame. error_m: estimated minus true lateral position, positive to the left; None
    without a line. sigma_m: the pipeline's own standard deviation of it."""

    frame: int
    side: str
    ahead_m: float
    error_m: float | None
    sigma_m: float | None


def errors(
    name: str, detector: Detects[RawLanes], frames: range, params: Params | None = None, every: int = 1
) -> Iterator[LaneError]:
    """Run consecutive ``frames`` of a built-in scenario, with the lane detector on every ``every``-th one."""
    played = scenario.load(name)
    sensors = SensorRig(played, world_state.at(played, played.duration_s).s_m)
    detectors, state = Detectors(None, detector, every), State()
    for index in frames:
        now = world_state.at(played, index / played.rate_hz)
        frame = sensors.frame(now, index, round(index / played.rate_hz * 1e9))
        _, state, result, _ = advance(state, frame, params or Params(), detectors)
        yield from _compared(index, result.layers.lanes, true_lines(played, now))


def true_lines(played: Scenario, now: World) -> dict[str, F64]:
    """``left`` and ``right`` paint of the lane that the ego vehicle is in: (K, 2) ego x, y."""
    road = played.road
    lanes = [lane for lane in range(-road.lanes_forward, road.lanes_oncoming + 1) if lane]
    middle = min((road.lane_offset_m(lane) for lane in lanes), key=lambda d: abs(d - now.d_m))
    s = now.s_m + np.arange(-_BEHIND_M, _BEYOND_M, _STEP_M)
    edges = {"left": middle + road.lane_width_m / 2.0, "right": middle - road.lane_width_m / 2.0}
    return {side: now.to_ego(road.to_world(s, _painted(road, d))) for side, d in edges.items()}


def _painted(road: Road, edge_m: float) -> float:
    """Lateral position of the paint at a lane's edge. Solid lines lie slightly inside the carriageway."""
    return next((d for d in edge_paint_m(road) if abs(d - edge_m) < _NEAR_M), edge_m)


def summary(found: Sequence[LaneError]) -> dict[float, tuple[float, float, float]]:
    """By distance: share of frames with a line, median and 95th percentile of the absolute error in metres."""
    table = {}
    for ahead in AHEAD_M:
        here = [each.error_m for each in found if each.ahead_m == ahead]
        seen = np.abs([error for error in here if error is not None])
        median, most = (float(np.percentile(seen, q)) for q in (50, 95)) if len(seen) else (np.nan, np.nan)
        table[ahead] = (len(seen) / max(len(here), 1), median, most)
    return table


def _compared(index: int, lane: EgoLane | None, truth: dict[str, F64]) -> Iterator[LaneError]:
    for side, line in (("left", lane.left if lane else None), ("right", lane.right if lane else None)):
        for ahead in AHEAD_M:
            yield LaneError(index, side, ahead, *_off(line, ahead, truth[side]))


def _off(line: LaneLine | None, ahead_m: float, truth: F64) -> tuple[float | None, float | None]:
    if line is None:
        return None, None
    true_m = float(np.interp(ahead_m, truth[:, 0], truth[:, 1]))
    return float(line.y_m(ahead_m)) - true_m, float(line.sigma_m(ahead_m))
