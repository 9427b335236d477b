"""Signs, in words."""

from __future__ import annotations

import pytest

from pipeline.common.fast_replace import evolve
from pipeline.decision.object_motion import closing_speed_mps, describe
from pipeline.params import MotionParams
from pipeline.types import EgoState, ObjectSource
from tests.pipeline.build import fused

PARAMS = MotionParams()


@pytest.mark.parametrize(
    ("relative", "closing", "ttc"),
    [
        pytest.param((-5.0, 0.0), 5.0, 4.0, id="lead slower: positive closing speed, finite TTC"),
        pytest.param((5.0, 0.0), -5.0, None, id="lead pulls away: negative closing speed, no TTC"),
        pytest.param((0.0, 0.0), 0.0, None, id="same speed: no TTC"),
        pytest.param((0.0, 3.0), 0.0, None, id="moving across only"),
        pytest.param((-0.05, 0.0), 0.05, None, id="too slow to be measured: no TTC of minutes"),
        pytest.param(None, None, None, id="velocity not known: nothing made up"),
    ],
)
def test_closing(relative: tuple[float, float] | None, closing: float | None, ttc: float | None) -> None:
    (item,) = describe([fused(1, 20.0, velocity=relative)], None, PARAMS)
    assert closing_speed_mps(item) == (pytest.approx(closing) if closing is not None else None)
    assert item.ttc_s == (pytest.approx(ttc) if ttc is not None else None)


@pytest.mark.parametrize(
    ("ego", "relative", "speed", "moving"),
    [
        pytest.param(EgoState(0, 20.0), (-20.0, 0.0), 0.0, False, id="parked car"),
        pytest.param(EgoState(0, 20.0), (0.0, 0.0), 20.0, True, id="lead at our speed"),
        pytest.param(EgoState(0, 20.0), (-35.0, 0.0), 15.0, True, id="oncoming"),
        pytest.param(EgoState(0, 10.0, 0.1), (-10.0, -2.0), 0.0, False, id="parked car while we turn left"),
        pytest.param(None, (0.0, 0.0), None, None, id="ego speed not known"),
    ],
)
def test_over_ground(
    ego: EgoState | None, relative: tuple[float, float], speed: float | None, moving: bool | None
) -> None:
    (item,) = describe([fused(1, 20.0, velocity=relative)], ego, PARAMS)
    assert item.speed_over_ground_mps == (pytest.approx(speed, abs=1e-9) if speed is not None else None)
    assert item.moving is moving


def test_a_parked_car_aside_stands_still_while_we_turn() -> None:
    """In a frame that turns at 0.1 rad/s, an object standing at (20, 8) seems to move at 0.8 m/s forwards and 2 m/s to
    the right."""
    (item,) = describe([fused(1, 20.0, 8.0, velocity=(-10.0 + 0.8, -2.0))], EgoState(0, 10.0, 0.1), PARAMS)
    assert item.closest_point is not None
    assert item.closest_point[:2] == (20.0, 8.0)
    assert item.speed_over_ground_mps == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("velocity", "oncoming"),
    [
        pytest.param((-35.0, 0.0), True, id="drives towards us"),
        pytest.param((-20.0, 0.0), False, id="stands"),
        pytest.param((-15.0, 0.0), False, id="is slower than we are"),
        pytest.param((-20.0, 8.0), False, id="crosses"),
    ],
)
def test_oncoming_is_what_comes_nearer_by_its_own_motion(velocity: tuple[float, float], oncoming: bool) -> None:
    (item,) = describe([fused(1, 30.0, velocity=velocity)], EgoState(0, 20.0), PARAMS)
    assert item.oncoming is oncoming


def test_an_object_without_a_place_has_no_ttc() -> None:
    (item,) = describe([fused(1, None, source="V")], EgoState(0, 20.0), PARAMS)
    assert (item.ttc_s, item.speed_over_ground_mps, item.moving) == (None, None, None)


@pytest.mark.parametrize(
    ("speed", "sigma", "surely"),
    [
        pytest.param(8.0, 5.0, False, id="a parked car, as the camera first has it"),
        pytest.param(8.0, 1.0, True, id="eight metres a second, known well"),
        pytest.param(8.0, None, True, id="by the LiDAR"),
        pytest.param(1.0, None, False, id="standing"),
    ],
)
def test_an_uncertain_speed_proves_no_motion(speed: float, sigma: float | None, surely: bool) -> None:
    seen = evolve(fused(1, 30.0, velocity=(speed - 10.0, 0.0)), camera_speed_sigma_mps=sigma)
    (item,) = describe([seen], EgoState(0, 10.0, 0.0), PARAMS)
    assert item.surely_moving is surely
    assert item.moving is (speed > PARAMS.moving_mps), "the result's meaning of it stays"
    (unknown,) = describe([seen], None, PARAMS)
    assert unknown.surely_moving is None


@pytest.mark.parametrize(
    ("speed", "sightings", "surely"),
    [
        pytest.param(10.0, 4, False, id="a new side that came into view"),
        pytest.param(10.0, 5, True, id="traffic"),
        pytest.param(2.5, 5, False, id="slow, and just seen"),
        pytest.param(2.5, 10, True, id="slow, and followed"),
    ],
)
def test_a_speed_from_a_few_clusters_proves_no_motion(speed: float, sightings: int, surely: bool) -> None:
    seen = fused(1, 30.0, velocity=(speed - 10.0, 0.0), hits=sightings)
    (item,) = describe([seen], EgoState(0, 10.0, 0.0), PARAMS)
    assert (item.moving, item.surely_moving) == (True, surely)


@pytest.mark.parametrize(("dt_s", "surely"), [(0.1, False), (0.3, True)])
def test_at_a_lower_rate_fewer_sightings_prove_motion(dt_s: float, surely: bool) -> None:
    (item,) = describe([fused(1, 30.0, hits=3)], EgoState(0, 10.0, 0.0), PARAMS, dt_s)
    assert item.surely_moving is surely


@pytest.mark.parametrize(
    ("source", "share", "wander_mps", "surely"),
    [
        pytest.param("V", 0.8, 0.0, True, id="boxed in most images"),
        pytest.param("V", 0.2, 0.0, False, id="boxed in every fifth: perhaps another car each time"),
        pytest.param("VL", 0.2, 0.0, True, id="the LiDAR follows it"),
        pytest.param("V", 0.8, 5.0, False, id="its boxes wander by as much"),
    ],
)
def test_boxes_that_hop_or_wander_prove_no_motion(
    source: ObjectSource, share: float, wander_mps: float, surely: bool
) -> None:
    seen = evolve(fused(1, 40.0, source=source), boxed_share=share, camera_wander_mps=wander_mps)
    (item,) = describe([seen], EgoState(0, 10.0, 0.0), PARAMS)
    assert item.surely_moving is surely


@pytest.mark.parametrize(
    ("known", "sigma_mps"),
    [
        pytest.param({"camera_speed_sigma_mps": 3.0, "camera_wander_mps": 4.0}, 5.0, id="boxes that wander"),
        pytest.param({"camera_speed_sigma_mps": 3.0, "boxed_share": 0.2}, None, id="another car each time, perhaps"),
        pytest.param({}, None, id="nobody says how well"),
        pytest.param({"lidar_speed_sigma_mps": 0.5, "ranged_steady": 30}, 0.5, id="the LiDAR's filter, settled"),
        pytest.param({"lidar_speed_sigma_mps": 0.6, "ranged_steady": 4}, 0.866, id="four sightings of 0.2 m each"),
        pytest.param({"lidar_speed_sigma_mps": 0.5, "ranged_steady": 0}, None, id="it has just jumped"),
    ],
)
def test_how_well_the_speed_over_ground_is_known(known: dict[str, float], sigma_mps: float | None) -> None:
    seen = evolve(fused(1, 40.0, source="VL" if "ranged_steady" in known else "V"), **known)
    (item,) = describe([seen], EgoState(0, 10.0, 0.0), PARAMS)
    expected = pytest.approx(sigma_mps, abs=0.001) if sigma_mps is not None else None
    assert item.speed_over_ground_sigma_mps == expected
    (without_ego_speed,) = describe([seen], None, PARAMS)
    assert without_ego_speed.speed_over_ground_sigma_mps is None
