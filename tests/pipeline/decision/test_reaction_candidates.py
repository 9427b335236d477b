"""What deserves a reaction, and what must not cause one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.decision.cipv import CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.decision.reaction_candidates import enters_corridor, is_dependable
from pipeline.params import AebParams, CipvParams, MotionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import Cipv, EgoState, FusedObject
from tests.pipeline.build import fused, moment

PATH = corridor(None, PathParams(half_width_m=1.5))


def judged(item: FusedObject, ego_mps: float | None = 20.0) -> FusedObject:
    """The object as the pipeline describes it before any reaction."""
    ego = EgoState(0, ego_mps) if ego_mps is not None else None
    (item,) = choose(CipvState(), describe([item], ego, MotionParams()), PATH, moment(ego), CipvParams())[1].objects
    return item


@pytest.mark.parametrize(
    ("item", "dependable"),
    [
        pytest.param(fused(1, 15.0, 3.0), True, id="both sensors"),
        pytest.param(fused(1, 15.0, 3.0, source="L"), True, id="LiDAR, confirmed, as large as a car"),
        pytest.param(fused(1, 15.0, 3.0, label="person"), True, id="a person is hit no less"),
        pytest.param(fused(1, 15.0, 3.0, source="V"), False, id="camera alone: its speed comes from a box height"),
        pytest.param(fused(1, 15.0, 3.0, source="L", hits=2), False, id="a blob seen twice"),
        pytest.param(
            dataclasses.replace(fused(1, 15.0, 3.0, hits=40), ranged_steady=2),
            False,
            id="followed by the camera for long, by the LiDAR only since the sweep before",
        ),
        pytest.param(
            dataclasses.replace(fused(1, 15.0, 3.0, hits=40), ranged_steady=0),
            False,
            id="followed for long, but another part of it was seen",
        ),
        pytest.param(fused(1, 15.0, 3.0, source="L", height=0.1), False, id="a kerb"),
        pytest.param(dataclasses.replace(fused(1, 15.0, 3.0), seen_by=""), False, id="not seen now"),
    ],
)
def test_dependable(item: FusedObject, dependable: bool) -> None:
    assert is_dependable(judged(item)) is dependable


def test_nothing_is_dependable_before_it_was_judged() -> None:
    assert not is_dependable(fused(1, 15.0))


@pytest.mark.parametrize(
    ("item", "ego_mps", "enters"),
    [
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, -2.0)), 20.0, True, id="a slower car swerves in"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, 0.0)), 20.0, False, id="a slower car keeps its lane"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, 2.0)), 20.0, False, id="a slower car moves away"),
        pytest.param(
            fused(1, 30.0, 3.5, velocity=(-20.0, -1.4)), 20.0, False, id="a post beside the road does not swerve"
        ),
        pytest.param(fused(1, 30.0, 2.0, velocity=(-10.0, -0.4)), 20.0, False, id="sideways noise is not believed"),
        pytest.param(
            fused(1, 22.0, -2.9, velocity=(-20.0, 1.9), hits=6), 20.0, False, id="half of a parked car's points vanish"
        ),
        pytest.param(fused(1, 30.0, 0.5, velocity=(-20.0, 0.0)), 20.0, True, id="a standing obstacle in the corridor"),
        pytest.param(fused(1, 30.0, -8.0, velocity=(-20.0, 6.0)), 20.0, True, id="a crossing car will be there"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(5.0, -2.0)), 20.0, False, id="it pulls away: never reached"),
        pytest.param(fused(1, 0.1, 2.7, velocity=(-2.0, -1.5)), 20.0, False, id="abreast of us"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, -2.0)), None, True, id="ego speed not known"),
    ],
)
def test_enters_corridor(item: FusedObject, ego_mps: float | None, enters: bool) -> None:
    assert enters_corridor(judged(item, ego_mps), PATH, None, AebParams()) is enters


def from_the_side(x: float, front_y: float, sideways_mps: float, ego_mps: float = 5.5) -> FusedObject:
    """A car of 4.4 m across our way, at 20 km/h."""
    middle_y = front_y + 2.2 if front_y > 0.0 else front_y - 2.2
    item = fused(1, x, middle_y, velocity=(-ego_mps, sideways_mps), length=1.8, width=4.4)
    return dataclasses.replace(item, closest_point=(x, front_y, 0.0), distance_m=float(np.hypot(x, front_y)))


@pytest.mark.parametrize(
    ("item", "enters"),
    [
        pytest.param(from_the_side(5.1, 4.1, -5.5), True, id="from the left, its front 2.6 m beside the path"),
        pytest.param(from_the_side(5.1, -4.1, 5.5), True, id="from the right"),
        pytest.param(from_the_side(8.0, 7.0, -5.5), False, id="its driver can still give way"),
        pytest.param(from_the_side(5.1, 4.1, 5.5), False, id="it drives away"),
        pytest.param(from_the_side(5.1, 4.1, -1.5), False, id="it rolls to the line"),
        pytest.param(from_the_side(0.6, 4.1, -5.5), False, id="beside the car"),
    ],
)
def test_what_crosses_enters_with_its_front(item: FusedObject, enters: bool) -> None:
    """At 20 km/h each, as in Euro NCAP's CCCscp. The middle of its side is over the edge 0.4 s later."""
    assert enters_corridor(judged(item, 5.5), PATH, None, AebParams()) is enters
    assert not enters_corridor(judged(item, 5.5), PATH, None, AebParams(react_to_crossing=False))


def walker(y: float, sideways_mps: float, label: str = "person") -> FusedObject:
    """Half a metre wide, 12 m ahead of a car that drives at 50 km/h."""
    return fused(1, 12.0, y, velocity=(-13.9, sideways_mps), label=label, length=0.5, width=0.5)


@pytest.mark.parametrize(
    ("item", "enters"),
    [
        pytest.param(walker(-1.6, 1.4), True, id="steps over the edge"),
        pytest.param(walker(1.6, -1.4), True, id="from the left"),
        pytest.param(walker(-1.6, 1.4, "bicycle"), True, id="pushes a bicycle"),
        pytest.param(walker(-2.2, 1.4), False, id="may still stop beside the path"),
        pytest.param(walker(-1.6, 0.6), False, id="walks along the edge"),
        pytest.param(walker(-1.6, -1.4), False, id="steps back"),
        pytest.param(walker(-1.6, 1.4, "car"), False, id="a parked car does not walk"),
    ],
)
def test_a_person_steps_in(item: FusedObject, enters: bool) -> None:
    """At a walking pace, nothing surely moves."""
    known = judged(item, 13.9)
    assert known.surely_moving is False
    assert enters_corridor(known, PATH, None, AebParams()) is enters
    assert not enters_corridor(known, PATH, None, AebParams(react_to_crossing=False))


@pytest.mark.parametrize(
    ("item", "enters"),
    [
        pytest.param(walker(-3.2, 3.0), True, id="a person who will be before the car"),
        pytest.param(walker(-3.5, 3.0), False, id="a person who will be beside its side"),
        pytest.param(walker(3.5, -3.0), False, id="the same from the left"),
        pytest.param(walker(-3.5, 3.0, "car"), True, id="a vehicle, which is wider, in the path"),
    ],
)
def test_a_person_is_met_before_the_car_only(item: FusedObject, enters: bool) -> None:
    """In 0.86 s, by 2.5 m/s, as much as surely is no noise, the first is 1.0 m and the others 1.35 m from the middle of
    a path that is 1.5 m wide on either side."""
    known = judged(item, 13.9)
    assert known.surely_moving
    assert enters_corridor(known, PATH, None, AebParams()) is enters


@pytest.mark.parametrize(
    ("then_m", "params", "enters"),
    [
        pytest.param(0.9, AebParams(), True, id="inside"),
        pytest.param(2.4, AebParams(), False, id="out"),
        pytest.param(2.4, AebParams(react_to_present=False), True, id="out, switched off"),
    ],
)
def test_where_it_is_seen_now_counts_as_well(then_m: float, params: AebParams, enters: bool) -> None:
    """Its first cluster was also that of the lead, so by the mean of both sightings it is in the path."""
    ego, now = EgoState(0, 20.0), moment(EgoState(0, 20.0), 0.1)
    first, then = (fused(1, x, y, source="L", velocity=(-20.0, 0.0)) for x, y in ((22.0, 0.2), (20.0, then_m)))
    state, _ = choose(CipvState(), describe([first], ego, MotionParams()), PATH, now, CipvParams())
    (item,) = choose(state, describe([then], ego, MotionParams()), PATH, now, CipvParams())[1].objects
    assert item.in_path
    assert enters_corridor(item, PATH, None, params) is enters


OVER_THERE = fused(1, 30.0, -8.0, velocity=(-20.0, 6.0))
"""It crosses and will enter the corridor."""
IN_OUR_LANE = fused(1, 30.0, 0.2, velocity=(-35.0, 0.0))
"""It is oncoming."""
CROSSES_OVER = fused(1, 29.0, -0.8, velocity=(-29.0, 2.5))
"""It is oncoming, and in our lane only on its way from one side to the other, as before a bend."""
LEAVES = fused(1, 29.0, 0.4, velocity=(-29.0, 2.5))
"""It is oncoming, and leaves our lane for its own, as at the end of a bend."""
JUST_RANGED = dataclasses.replace(fused(1, 30.0, 0.9, velocity=(-35.0, 0.0)), ranged_steady=3)
"""It is oncoming at the edge of our lane, and not surely moving after three sweeps."""
SEEN_FROM_ANOTHER_SIDE = dataclasses.replace(fused(1, 15.0, 2.0, velocity=(-29.0, -2.8)), ranged_steady=1)
"""It is oncoming in its own lane. Its flank has come into view a sweep ago, so that it seems to move sideways."""
COMES_OVER = dataclasses.replace(SEEN_FROM_ANOTHER_SIDE, ranged_steady=8)
"""It is oncoming, and steers into our lane."""
STANDS = fused(1, 30.0, 0.2, velocity=(-20.0, 0.0))


@pytest.mark.parametrize(
    ("item", "path_sigma_m", "lead_m", "enters"),
    [
        pytest.param(OVER_THERE, 0.3, None, True, id="crosses"),
        pytest.param(OVER_THERE, 2.5, None, False, id="crosses, on a path that may bend that way"),
        pytest.param(OVER_THERE, 0.3, 12.0, False, id="crosses behind the lead"),
        pytest.param(OVER_THERE, 0.3, 60.0, True, id="crosses before the lead"),
        pytest.param(IN_OUR_LANE, 0.3, None, True, id="oncoming, in our lane"),
        pytest.param(IN_OUR_LANE, 2.5, None, False, id="oncoming, before a bend"),
        pytest.param(IN_OUR_LANE, 1.0, None, False, id="oncoming, in our lane, more likely than not"),
        pytest.param(IN_OUR_LANE, 0.3, 12.0, False, id="oncoming, behind the lead"),
        pytest.param(CROSSES_OVER, 0.3, None, False, id="oncoming, in our lane for a moment"),
        pytest.param(LEAVES, 0.3, None, False, id="oncoming, still in our lane"),
        pytest.param(JUST_RANGED, 0.6, None, False, id="oncoming, just ranged, at the edge"),
        pytest.param(JUST_RANGED, 0.1, None, True, id="oncoming, just ranged, surely in our lane"),
        pytest.param(SEEN_FROM_ANOTHER_SIDE, 0.1, None, False, id="oncoming, its flank comes into view"),
        pytest.param(COMES_OVER, 0.1, None, True, id="oncoming, and steers into our lane"),
        pytest.param(STANDS, 2.5, None, True, id="stands in the way, wherever that leads"),
        pytest.param(STANDS, 0.3, 12.0, True, id="stands before the lead, which may swerve"),
    ],
)
def test_where_a_course_says_nothing(
    item: FusedObject, path_sigma_m: float, lead_m: float | None, enters: bool
) -> None:
    path = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), path_sigma_m))
    lead = Cipv(9, lead_m, 0.0, None, "") if lead_m is not None else None
    known = judged(item, 20.0)
    assert enters_corridor(known, path, lead, AebParams()) is enters
    also_before = enters_corridor(known, path, lead, AebParams(react_where_met=False))
    assert also_before is (enters or item in (CROSSES_OVER, LEAVES, SEEN_FROM_ANOTHER_SIDE))
