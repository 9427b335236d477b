"""A crossing object is in the path only if it will still be there when the car arrives."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import pytest

from pipeline.decision import cipv, reaction_candidates
from pipeline.decision.cipv import Choice, CipvState
from pipeline.decision.object_motion import describe
from pipeline.params import AebParams, CipvParams, MotionParams, Params, PathParams, with_changes
from pipeline.path.corridor import corridor
from pipeline.run import only
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.unseen import frames
from pipeline.step import State, step
from pipeline.types import EgoState, FusedObject, Moment, Result
from tests.pipeline.build import fused

PATH = corridor(None, PathParams(half_width_m=1.5))


def chosen(item: FusedObject, ego_mps: float | None, params: CipvParams | None = None) -> Choice:
    """The choice after three consecutive frames, so that an object seen by one sensor is confirmed."""
    ego = EgoState(0, ego_mps, 0.0) if ego_mps is not None else None
    (seen,) = describe([item], ego, MotionParams())
    state = CipvState()
    for _ in range(3):
        state, found = cipv.choose(state, (seen,), PATH, Moment(0, 0.1, ego, ego), params or CipvParams())
    return found


def crosser(x: float, sideways_mps: float, ego_mps: float, *, y: float = 0.0, forward_mps: float = 0.0) -> FusedObject:
    """A car in the path. forward_mps: its speed along the path, over ground."""
    return dataclasses.replace(fused(1, x, y), velocity_mps=(forward_mps - ego_mps, sideways_mps))


@pytest.mark.parametrize(
    ("item", "ego_mps", "leads"),
    [
        pytest.param(crosser(12.0, 8.0, 0.0), 0.0, False, id="passes in front of a car at a red light"),
        pytest.param(crosser(12.0, -8.0, 0.0), 0.0, False, id="from the other side"),
        pytest.param(crosser(30.0, 8.0, 10.0), 10.0, False, id="gone two seconds before the car arrives"),
        pytest.param(crosser(10.0, 3.0, 12.0), 12.0, True, id="still there when the car arrives"),
        pytest.param(crosser(30.0, 1.0, 10.0), 10.0, True, id="creeps across"),
        pytest.param(crosser(30.0, 0.0, 10.0), 10.0, True, id="stands across"),
        pytest.param(crosser(20.0, 2.5, 12.0, forward_mps=12.0), 12.0, True, id="changes lanes"),
        pytest.param(crosser(12.0, 3.0, 3.0, forward_mps=2.0), 3.0, False, id="a lead that has nearly turned off"),
        pytest.param(crosser(6.0, 3.5, 10.0, forward_mps=3.0), 10.0, True, id="turns off close in front of the car"),
    ],
)
def test_who_crosses_leads_only_if_it_is_met(item: FusedObject, ego_mps: float, leads: bool) -> None:
    found = chosen(item, ego_mps)
    (judged,) = found.objects
    assert (found.lead is not None) is leads
    assert judged.in_path is leads
    assert (judged.clears_path_s is None) is leads
    if not leads:
        assert found.rejected[0].reason.startswith("crossing: clears the path ")
        assert found.next_lead is None
        assert not reaction_candidates.enters_corridor(judged, PATH, None, AebParams())


@pytest.mark.parametrize(
    ("ranged_steady", "camera_ranges", "is_known"), [(1, 3, False), (2, 4, False), (3, 3, True), (1, 5, True)]
)
def test_what_the_lidar_has_just_found_crosses_once_a_speed_is_known(
    ranged_steady: int, camera_ranges: int, is_known: bool
) -> None:
    """A box that jumps from one far car to the next seems to move sideways as fast as cross traffic."""
    seen = dataclasses.replace(
        crosser(30.0, 8.0, 10.0), source="VL", ranged_steady=ranged_steady, camera_ranges=camera_ranges
    )
    (judged,) = chosen(seen, 10.0).objects
    assert (judged.clears_path_s is not None) is is_known


def test_it_may_be_switched_off() -> None:
    assert chosen(crosser(12.0, 8.0, 0.0), 0.0, CipvParams(use_crossing=False)).lead is not None


def test_what_will_cross_is_not_the_next_lead() -> None:
    coming = dataclasses.replace(crosser(25.0, -8.0, 8.0, y=9.0))
    assert chosen(coming, 8.0).next_lead is None
    assert chosen(coming, 8.0, CipvParams(use_crossing=False)).next_lead is not None


@pytest.mark.parametrize(("width", "leads"), [(1.8, True), (4.5, False)])
def test_without_ego_speed_only_what_shows_its_flank_crosses(width: float, leads: bool) -> None:
    """In a bend, the lead in front seems to move sideways too."""
    item = dataclasses.replace(fused(1, 15.0, 0.0, width=width), velocity_mps=(0.0, 5.0))
    assert (chosen(item, None).lead is not None) is leads


CROSS_TRAFFIC = [
    {"id": k, "kind": kind, "colour": "#a3202a", "approach": side, "arrive_s": 2.0 + 2.1 * k, "speed_mps": {0: speed}}
    for k, (kind, side, speed) in enumerate(
        (("car", "left", 8.0), ("van", "right", 10.0), ("truck", "left", 7.0), ("car", "right", 11.0)), start=1
    )
]


def at_a_red_light(sensors: str, knows_speed: bool, params: Params) -> Iterator[Result]:
    scene = Scenario.model_validate({
        "title": "red light", "seed": 1, "duration_s": 12.0,
        "road": {"segments": [{"length_m": 900}], "crossings": [{"s_m": 114}], "shoulder_m": 1.0},
        "ego": {"lane": -1, "speed_mps": {0: 0.0}, "start_m": 100},
        "crossing_actors": CROSS_TRAFFIC,
        "detections": {"measured": True},
    })  # fmt: skip
    state = State()
    for _, frame in frames(scene):
        seen = only(frame, sensors)  # type: ignore[arg-type]
        seen = seen if knows_speed else dataclasses.replace(seen, ego=None, gnss=None)
        state, result = step(state, seen, params)
        yield result


def frames_with_a_lead(sensors: str, knows_speed: bool, params: Params) -> int:
    return sum(each.cipv is not None for each in at_a_red_light(sensors, knows_speed, params))


@pytest.mark.parametrize("knows_speed", [True, False])
@pytest.mark.parametrize("sensors", ["both", "camera", "lidar"])
def test_at_a_red_light_cross_traffic_does_not_lead(sensors: str, knows_speed: bool) -> None:
    """In 120 frames, except for the first sightings of a vehicle, before its speed is known. The camera alone, on a car
    that does not know its own speed, is slower to tell."""
    only_boxes = sensors == "camera" and not knows_speed
    assert frames_with_a_lead(sensors, knows_speed, Params()) <= (10 if only_boxes else 5)


def test_without_the_rule_it_leads() -> None:
    assert frames_with_a_lead("both", True, with_changes(Params(), {"cipv.use_crossing": False})) > 20
