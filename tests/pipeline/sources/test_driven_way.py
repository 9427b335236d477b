"""Which vehicle is on the way of the car, and where that is not known."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, sin

import pytest

from pipeline.sources import open_source
from pipeline.sources.driven_way import DrivenWay
from pipeline.types import EgoState
from pipeline.types.source import TruthObject
from tests.pipeline.build import cuboid

RADIUS_M, SPEED_MPS, TICK_NS = 80.0, 12.0, 100_000_000
Motion = Callable[[int], EgoState | None]


def turning(tick: int) -> EgoState:
    return EgoState(tick, SPEED_MPS, SPEED_MPS / RADIUS_M, source="can")


def way(motion: Motion = turning, ticks: int = 60, gap_at: int | None = None, gap_ns: int = 0) -> DrivenWay:
    times = [n * TICK_NS + (gap_ns if gap_at is not None and n >= gap_at else 0) for n in range(ticks)]
    return DrivenWay(times, [motion(each) for each in times])


def at(along_m: float, left_m: float = 0.0) -> TruthObject:
    """A car whose centre is beside the circle that the car drives on."""
    turned = along_m / RADIUS_M
    x, y = (RADIUS_M - left_m) * sin(turned), RADIUS_M - (RADIUS_M - left_m) * cos(turned)
    return TruthObject("car", cuboid(x - 2.0, y))


def offsets(driven: DrivenWay, *objects: TruthObject, index: int = 0) -> list[float | None]:
    return [each.path_offset_m for each in driven.placed(index * TICK_NS, objects)]


@pytest.mark.parametrize("left_m", [-3.5, 0.0, 3.5])
def test_offsets_are_across_the_way_in_a_bend(left_m: float) -> None:
    assert offsets(way(), at(45.0, left_m), at(10.0, left_m)) == pytest.approx([left_m, left_m], abs=0.02)
    assert offsets(way(), at(45.0, left_m), index=20) == pytest.approx([left_m], abs=0.02), "from every frame on"


def test_what_is_straight_ahead_of_a_turning_car_is_beside_its_way() -> None:
    straight_ahead = TruthObject("car", cuboid(40.0, 0.0))
    (offset,) = offsets(way(), straight_ahead)
    assert offset == pytest.approx(-(hypot(42.0, RADIUS_M) - RADIUS_M), abs=0.02)


def no_speed(tick: int) -> EgoState | None:
    return None if tick >= 20 * TICK_NS else turning(tick)


def no_yaw_rate(tick: int) -> EgoState:
    return EgoState(tick, SPEED_MPS, None, source="gnss")


def waiting(tick: int) -> EgoState:
    return turning(tick) if tick > 40_000_000_000 else standing(tick)


def standing(tick: int) -> EgoState:
    return EgoState(tick, 0.0, 0.0, source="can")


@pytest.mark.parametrize(
    ("driven", "known"),
    [
        pytest.param(way(ticks=20), [True, False], id="the recording ends"),
        pytest.param(way(no_speed), [True, False], id="the speed is lost"),
        pytest.param(way(gap_at=20, gap_ns=2_000_000_000), [True, False], id="a gap of two seconds"),
        pytest.param(way(gap_at=20, gap_ns=-60 * TICK_NS), [True, False], id="another clip"),
        pytest.param(way(gap_at=20, gap_ns=500_000_000), [True, True], id="a gap of half a second"),
        pytest.param(way(no_yaw_rate), [False, False], id="without a yaw rate"),
        pytest.param(way(standing), [False, False], id="a standing car"),
        pytest.param(way(waiting, ticks=500), [False, False], id="a car that waits for 40 s"),
    ],
)
def test_the_way_is_known_as_far_as_the_motion_is(driven: DrivenWay, known: list[bool]) -> None:
    """20 frames are 23 m."""
    assert [offset is not None for offset in offsets(driven, at(20.0), at(40.0))] == known


def test_a_frame_of_another_recording_has_no_way() -> None:
    assert [each.path_offset_m for each in way().placed(-5, [at(20.0)])] == [None]


def test_a_recording_is_read_without_its_images(monkeypatch: pytest.MonkeyPatch) -> None:
    source = open_source("sim:straight")
    monkeypatch.setattr(source, "frame", None)
    assert DrivenWay.of(source).ahead(0)[-1, 0] == pytest.approx(150.0, abs=2.0)
