"""Who is the closest in-path vehicle in one frame, and the reason for each one that is not."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.decision.cipv import CipvState, choose
from pipeline.fusion.last_place import LastPlace
from pipeline.params import CipvParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import EgoState, FusedObject
from tests.pipeline.build import fused, moment
from tests.pipeline.decision.choosing import PARAMS, PATH, decide


def test_the_nearest_in_path_leads_and_every_other_says_why_not() -> None:
    lead, why_not = decide(fused(1, 40.0), fused(2, 25.0, 0.4), fused(3, 12.0, 3.5), fused(4, 12.0, -3.2))
    assert lead is not None
    assert lead.id == 2
    assert lead.distance_m == pytest.approx(25.0, abs=0.01)
    assert lead.reason == "car seen by both sensors, nearest of 2 in path, 0.4 m left of its centre"
    assert why_not == {1: "behind #2", 3: "out of path by 2.0 m", 4: "out of path by 1.7 m"}


@pytest.mark.parametrize(
    ("ranged_by", "said"),
    [
        ({"returns": 1}, "car seen by camera only, ranged by 1 LiDAR return, alone in path"),
        ({"height_from": "road"}, "car seen by camera only, placed by where it meets the road, alone in path"),
        ({"height_from": "class"}, "car seen by camera only, alone in path"),
    ],
)
def test_what_places_a_lead_without_a_cluster_is_said(ranged_by: dict[str, Any], said: str) -> None:
    lead, _ = decide(dataclasses.replace(fused(1, 40.0, source="V"), **ranged_by))
    assert lead is not None
    assert lead.reason.startswith(said)


@pytest.mark.parametrize(
    ("item", "reason"),
    [
        pytest.param(fused(1, 20.0, label="person"), "class person", id="a person is no vehicle"),
        pytest.param(fused(1, 20.0, label="bicycle"), "class bicycle", id="nor is a bicycle"),
        pytest.param(fused(1, None, source="V"), "distance unknown", id="box without a distance"),
        pytest.param(fused(1, 20.0, source="V", hits=2), "seen 2 of 3 times", id="camera alone, not confirmed"),
        pytest.param(fused(1, 20.0, source="L", hits=1), "seen 1 of 3 times", id="LiDAR alone, not confirmed"),
        pytest.param(fused(1, 20.0, source="L", width=0.3, length=0.2), "only 0.3 m wide", id="a post is not a rear"),
        pytest.param(fused(1, 20.0, source="L", height=0.2), "only 0.2 m high", id="a kerb is not a rear"),
        pytest.param(fused(1, 20.0, source="L", length=40.0), "40 by 2 m: not a vehicle", id="a wall"),
        pytest.param(
            fused(1, 2.0, source="L", length=11.0, width=7.8), "11 by 8 m: not a vehicle", id="several vehicles in one"
        ),
        pytest.param(fused(1, 20.0, 3.0), "out of path by 1.5 m", id="next lane"),
        pytest.param(fused(1, -6.0, 0.0), "beside or behind the bumper", id="behind us"),
    ],
)
def test_why_not(item: FusedObject, reason: str) -> None:
    lead, why_not = decide(item)
    assert lead is None
    assert why_not == {1: reason}


@pytest.mark.parametrize(("frames", "stays"), [(7, True), (3, False)])
def test_what_both_sensors_saw_as_a_vehicle_stays_one_while_the_lidar_follows_it(frames: int, stays: bool) -> None:
    """A truck at 55 m, on which one ring lies; the camera misses it for more than a second. After a few frames its box
    may have been a neighbour's."""
    state, sliver = CipvState(), fused(1, 20.0, source="L", height=0.1)
    for item in (*(fused(1, 20.0, label="truck"),) * frames, *(sliver,) * 5):
        state, choice = choose(state, (item,), PATH, moment(dt_s=0.1), PARAMS)
    assert (choice.lead is not None) == stays


@pytest.mark.parametrize(
    "item",
    [
        pytest.param(fused(1, 20.0, hits=1), id="both sensors: from its first frame"),
        pytest.param(fused(1, 20.0, source="V", hits=3), id="camera alone, confirmed"),
        pytest.param(fused(1, 20.0, source="L", hits=3), id="a nameless obstacle as large as a car"),
        pytest.param(fused(1, 20.0, label="truck"), id="a truck"),
        pytest.param(fused(1, 20.0, label="motorcycle", width=0.8, length=2.0), id="a motorcycle, however narrow"),
    ],
)
def test_who_may_lead(item: FusedObject) -> None:
    lead, _ = decide(item)
    assert lead is not None
    assert lead.id == 1


def test_the_gate_that_stopped_it_carries_number_and_limit() -> None:
    (item,), lead, _, _ = choose(CipvState(), (fused(1, 20.0, 3.0),), PATH, moment(), PARAMS)[1]
    assert lead is None
    failed = {gate.name: (gate.value, gate.limit) for gate in item.gates if not gate.passed}
    assert failed["path_offset"] == (pytest.approx(3.0), pytest.approx(1.5))
    assert len(failed) == 1


def test_a_camera_track_whose_place_was_reset_must_be_seen_again() -> None:
    """The first distance after a reset may be another vehicle's, however long the track's number has lived."""
    reset = dataclasses.replace(fused(1, 20.0, source="V", hits=29), camera_ranges=1)
    lead, why_not = decide(reset)
    assert lead is None
    assert why_not == {1: "seen 1 of 3 times"}
    assert decide(reset, last=1)[0] is not None, "the lead stays it"
    assert decide(dataclasses.replace(reset, camera_ranges=3))[0] is not None
    assert decide(dataclasses.replace(fused(1, 20.0, source="L", hits=29)))[0] is not None, "the LiDAR counts its own"


@pytest.mark.parametrize(
    ("hits", "seen_by", "params", "leads"),
    [
        pytest.param(1, "", PARAMS, False, id="a false box on a stray cluster"),
        pytest.param(1, "", CipvParams(confirm_lead=False), True, id="switched off"),
        pytest.param(1, "V", PARAMS, True, id="one sensor sees it again"),
        pytest.param(3, "", PARAMS, True, id="confirmed"),
    ],
)
def test_what_both_sensors_saw_once_leads_only_while_it_is_seen(
    hits: int, seen_by: Any, params: CipvParams, leads: bool
) -> None:
    item = dataclasses.replace(fused(1, 20.0, hits=hits), seen_by=seen_by)
    assert (choose(CipvState(1), (item,), PATH, moment(), params)[1].lead is not None) == leads


def test_how_large_a_cluster_may_be_across_is_a_parameter() -> None:
    several = fused(1, 2.0, source="L", length=11.0, width=7.8)
    assert decide(several)[0] is None
    assert choose(CipvState(), (several,), PATH, moment(), CipvParams(max_short_side_m=15.0))[1].lead is not None


@pytest.mark.parametrize(
    ("ranges", "source", "leads"),
    [
        pytest.param(21, "V", True, id="followed on"),
        pytest.param(1, "V", False, id="its place was reset: it may be another vehicle"),
        pytest.param(1, "VL", True, id="the LiDAR follows it"),
    ],
)
def test_a_lead_whose_place_was_reset_has_no_privilege(ranges: int, source: Any, leads: bool) -> None:
    """At the edge of the path, where only the current lead may stay."""
    followed = dataclasses.replace(fused(1, 20.0, 1.7, source=source, hits=20), camera_ranges=20)
    state = CipvState(1, places={1: LastPlace(20, 20.0, 2.0, ranged=False)})
    lead = choose(state, (dataclasses.replace(followed, camera_ranges=ranges),), PATH, moment(), PARAMS)[1].lead
    assert (lead is not None) == leads


@pytest.mark.parametrize(
    ("camera_m", "params", "is_in"),
    [
        pytest.param(32.0, PARAMS, True, id="about there: what was found out before still counts"),
        pytest.param(14.0, PARAMS, False, id="far from there: the camera looked at something else"),
        pytest.param(14.0, CipvParams(forget_at_takeover=False), True, id="switched off"),
    ],
)
def test_what_was_decided_by_the_camera_ends_where_the_lidar_finds_it_elsewhere(
    camera_m: float, params: CipvParams, is_in: bool
) -> None:
    seen = fused(1, 34.0, 3.0)
    state = CipvState(None, odds={1: 4.0}, places={1: LastPlace(20, camera_m, 1.0, ranged=False)})
    (item,) = choose(state, (seen,), PATH, moment(None, 0.1), params)[1].objects
    assert ((item.in_path_probability or 0.0) > 0.5) == is_in


def test_hysteresis_holds_the_lead_at_the_edge_but_takes_in_nobody_new() -> None:
    at_edge = fused(1, 20.0, 1.7)
    assert decide(at_edge, last=None)[0] is None
    held, _ = decide(at_edge, last=1)
    assert held is not None
    assert decide(fused(1, 20.0, 3.0), last=1)[0] is None


@pytest.mark.parametrize(
    ("sigma_m", "stay_probability", "stays"),
    [
        pytest.param(8.0, 0.4, True, id="its distance is uncertain by a third"),
        pytest.param(0.2, 0.4, False, id="its distance is measured"),
        pytest.param(8.0, 0.5, False, id="it must be in the path as probably as a new one"),
        pytest.param(8.0, 0.0, False, id="only its side of the edge counts"),
    ],
)
def test_a_lead_leaves_the_path_once_it_is_probably_outside(
    sigma_m: float, stay_probability: float, stays: bool
) -> None:
    """Half a metre outside, and seen so far aside that an error of its distance moves it across the path."""
    params = CipvParams(hysteresis_m=0.0, stay_probability=stay_probability)
    seen = dataclasses.replace(fused(1, 20.0, 2.0, source="V", velocity=None), distance_sigma_m=sigma_m)
    (item,) = (choice := choose(CipvState(1), (seen,), PATH, moment(), params)[1]).objects
    assert (item.path_margin_m or 0.0) < 0.0
    assert (choice.lead is not None, item.in_path) == (stays, stays)


def test_a_carried_object_may_stay_the_lead_but_not_become_it() -> None:
    unseen = dataclasses.replace(fused(1, 20.0), seen_by="")
    lead, why_not = decide(unseen)
    assert lead is None
    assert why_not == {1: "not seen in this frame"}
    held, _ = decide(unseen, last=1)
    assert held is not None


def test_a_box_too_near_to_be_measured_does_not_become_the_lead() -> None:
    """The edge of the image cuts a passing car's box: the car is seen, but its distance is only predicted."""
    cut = dataclasses.replace(fused(1, 1.5, source="V"), measured=False)
    lead, why_not = decide(cut)
    assert lead is None
    assert why_not == {1: "distance not measured in this frame"}


def test_in_path_is_relative_to_a_curved_path() -> None:
    """On a 200 m left arc the car 40 m ahead stands 4 m to the left; the one straight ahead is in the next lane."""
    bent = corridor(EgoState(0, 20.0, 0.1), PathParams(half_width_m=1.5))
    (on_arc, straight), lead, _, _ = choose(
        CipvState(), (fused(1, 40.0, 4.0), fused(2, 40.0, 0.0)), bent, moment(), PARAMS
    )[1]
    assert lead is not None
    assert lead.id == 1
    assert on_arc.in_path
    assert not straight.in_path
    assert straight.path_offset_m == pytest.approx(-4.0, abs=0.2)
    assert on_arc.in_path_probability > 0.6 > 0.4 > straight.in_path_probability  # type: ignore[operator]


@given(st.lists(st.tuples(st.floats(1, 90), st.floats(-6, 6), st.sampled_from(["V", "L", "VL"]), st.integers(1, 5))))
def test_everyone_is_either_the_lead_or_has_a_reason(
    things: list[tuple[float, float, str, int]],
) -> None:
    objects = [fused(i + 1, x, y, source=kind, hits=hits) for i, (x, y, kind, hits) in enumerate(things)]  # type: ignore[arg-type]
    lead, why_not = decide(*objects)
    assert set(why_not) | ({lead.id} if lead else set()) == {item.id for item in objects}
    assert len(why_not) + (lead is not None) == len(objects)
    assert all(why_not.values())
    if lead is not None:
        rivals = [o.distance_m for o in objects if why_not.get(o.id, "").startswith("behind #")]
        assert all(distance >= lead.distance_m for distance in rivals if distance is not None)


def test_a_nearer_car_that_only_the_camera_sees_still_leads() -> None:
    near = dataclasses.replace(fused(1, 20.0, source="V"), distance_sigma_m=2.0)
    lead, why_not = decide(near, fused(2, 40.0))
    assert lead is not None
    assert lead.id == 1
    assert why_not == {2: "behind #1"}
