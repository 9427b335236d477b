"""Camera and LiDAR see cars in different places."""

from __future__ import annotations

from math import cos, radians, sin

import pytest

from pipeline.fusion.agreement import AgreementState, follow, heed
from pipeline.params import FusionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import FusedObject, ObjectSource
from tests.pipeline.build import fused

PARAMS = FusionParams()


def at(number: int, bearing_deg: float, source: ObjectSource, range_m: float = 20.0, **more: float) -> FusedObject:
    turn = radians(bearing_deg)
    return fused(number, range_m * cos(turn), range_m * sin(turn), source, **more)  # type: ignore[arg-type]


def after_s(objects: tuple[FusedObject, ...], seconds: float = 3.0) -> AgreementState:
    state = AgreementState()
    for _ in range(round(seconds * 10)):
        state = follow(state, objects, 0.1, PARAMS)
    return state


@pytest.mark.parametrize(
    ("objects", "disagree"),
    [
        pytest.param((at(1, 0.0, "V"), at(2, 4.0, "L")), True, id="a car apart in both"),
        pytest.param((at(1, 0.0, "V"), at(2, 4.0, "L"), at(3, -9.0, "VL")), True, id="one apart, one together"),
        pytest.param((at(1, 0.0, "VL"), at(2, 4.0, "VL")), False, id="together"),
        pytest.param((at(1, 0.0, "V"),), False, id="a car that the LiDAR does not see"),
        pytest.param((at(1, 0.0, "L"),), False, id="a cluster that the camera does not see"),
        pytest.param((at(1, 0.0, "V"), at(2, 4.0, "L", range_m=24.0)), False, id="another range"),
        pytest.param((at(1, 0.0, "V"), at(2, 15.0, "L")), False, id="far aside"),
        pytest.param((at(1, 0.0, "V"), at(2, 4.0, "L", width=0.3, length=0.3)), False, id="a post"),
        pytest.param((at(1, 0.0, "V"), at(2, 4.0, "L", hits=1)), False, id="a cluster of one frame"),
        pytest.param((at(1, 0.0, "V", range_m=45.0), at(2, 4.0, "L", range_m=45.0)), False, id="too far for both"),
    ],
)
def test_cars_that_come_apart_for_long(objects: tuple[FusedObject, ...], disagree: bool) -> None:
    path = corridor(None, PathParams())
    heeded = heed(path, after_s(objects), PARAMS)
    assert path.usable
    assert heeded.usable is not disagree
    assert (heeded.confidence < 0.75 * path.confidence) is disagree
    assert (heeded is path) is not disagree


def test_one_cluster_is_the_place_of_one_car_only() -> None:
    one = (at(1, 0.0, "V"), at(2, 4.0, "L"), at(3, -9.0, "VL"))
    assert after_s((*one, at(4, 1.0, "V"))) == after_s(one), "the second box has no cluster left to be apart from"


def test_a_moment_says_nothing_and_an_empty_road_forgets_nothing() -> None:
    apart = (at(1, 0.0, "V"), at(2, 4.0, "L"))
    assert heed(corridor(None, PathParams()), after_s(apart, 0.4), PARAMS).usable
    state = after_s(apart)
    assert follow(state, (), 0.1, PARAMS) == state
