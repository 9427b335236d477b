"""The distance of a vehicle by where its box meets the road: when it is one, and how sure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pipeline.alignment.projection import Alignment, Angular, resolve
from pipeline.common.geometry import F64
from pipeline.fusion.ground_contact import NEAREST_M, measure_contacts, road_ahead
from pipeline.lidar.road_profile import RoadProfile
from pipeline.params import AlignmentParams, FusionParams
from pipeline.types import F32, Box, CameraCalibration, Detection, Ground, RoadSight, VisionMeasurement
from pipeline.vision.vehicle_height import HEIGHT_RATIOS, BoxShape, RoadContact, hinted
from tests.pipeline.lidar.test_road_profile import road

EYE_M, FOCAL_PX, HORIZON_PX, MIDDLE_PX = 1.2, 1200.0, 300.0, 640.0
"""The camera above the road."""


def aligned() -> Alignment:
    K = np.array([[FOCAL_PX, 0.0, MIDDLE_PX], [0.0, FOCAL_PX, HORIZON_PX], [0.0, 0.0, 1.0]])
    T_camera_ego = np.array([[0, -1, 0, 0], [0, 0, -1, EYE_M - 0.8], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
    found = resolve(AlignmentParams(), CameraCalibration(K, np.zeros(5), T_camera_ego, 1280, 720))
    assert found is not None
    return found


def swept(points: F32 | None = None, *boxes: VisionMeasurement) -> RoadProfile | None:
    """The road profile from these returns, without those on the boxes; by default, the only box is in the sky."""
    points = road() if points is None else points
    planes: F64 = np.array([[0.0, 0.0, 1.0, 0.8]])
    ground = Ground(np.ones(len(points), dtype=np.bool_), planes, np.array([0.0, 60.0]), np.array([True]))
    return road_ahead(points, ground, boxes or (seen((0.0, 0.0, 10.0, 10.0), 40.0),), aligned())


def box_of(range_m: float, height_m: float = 1.5, y_m: float = 0.0, width_m: float = 1.8) -> Box:
    """Box of an upright object on a flat road."""
    u, half = MIDDLE_PX - FOCAL_PX * y_m / range_m, FOCAL_PX * width_m / range_m / 2
    bottom = HORIZON_PX + FOCAL_PX * EYE_M / range_m
    return u - half, bottom - FOCAL_PX * height_m / range_m, u + half, bottom


def seen(bbox: Box, distance_m: float | None, label: str = "car") -> VisionMeasurement:
    place = None if distance_m is None else (distance_m, 0.0)
    sigma_m = None if distance_m is None else 0.2 * distance_m
    return VisionMeasurement(Detection(bbox, label, 0.8), distance_m, sigma_m, place, 0.05, 0.2)


def sight(*boxes: VisionMeasurement, points: F32 | None = None) -> RoadSight | None:
    """How the lower edge of the first box fits the road, given the others."""
    found = measure_contacts(boxes, swept(points), aligned(), FusionParams())
    assert found is not None
    return found[0].road


def ratio_and_sigma(found: RoadSight | None, usual: float = 1.0) -> tuple[float, float]:
    """The height over that of the class that a road alone tells of a vehicle of any height, and its sigma in ln."""
    assert found is not None
    height = hinted(BoxShape(), RoadContact().seen(found), 3.0)
    assert height.sigma is not None
    return height.factor * usual, height.sigma


@pytest.mark.parametrize("range_m", [15.0, 30.0, 45.0])
@pytest.mark.parametrize(("height_m", "by_height"), [(1.5, 1.0), (2.1, 0.7), (3.8, 0.4)])
def test_a_car_a_van_and_a_truck_stand_where_they_meet_the_road(
    range_m: float, height_m: float, by_height: float
) -> None:
    found = sight(seen(box_of(range_m, height_m), max(by_height * range_m, NEAREST_M)))
    assert found is not None
    fits = int(np.abs(found.above).argmin())
    assert max(by_height * range_m, NEAREST_M) * np.exp(HEIGHT_RATIOS[fits]) == pytest.approx(range_m, rel=0.05)


def test_the_farther_the_less_sure() -> None:
    sigmas = [ratio_and_sigma(sight(seen(box_of(range_m), range_m)))[1] for range_m in (15.0, 30.0, 45.0)]
    assert 0.07 <= sigmas[0] < sigmas[1] < sigmas[2] < 0.5


def test_the_taller_the_vehicle_the_less_sure() -> None:
    """The edge is off by a share of the box's height: for a lorry, three times as far down the road as for a car."""
    low, tall = (sight(seen(box_of(20.0, height_m), 20.0)) for height_m in (1.2, 3.6))
    assert low is not None
    assert tall is not None
    assert (tall.lasting > 1.5 * low.lasting).all()


def test_a_truck_at_100_m_is_no_car_at_40_m() -> None:
    """Where it meets the road is hardly known at that distance, but the road at 40 m is."""
    found = sight(seen(box_of(100.0, 3.75), 40.0))
    assert found is not None
    at_40, at_100 = (int(np.abs(HEIGHT_RATIOS - np.log(ratio)).argmin()) for ratio in (1.0, 2.5))
    assert found.above[at_40] > 3.0 * found.lasting[at_40]
    assert abs(found.above[at_100]) < found.lasting[at_100]


@pytest.mark.parametrize("slope", [-0.04, 0.04])
def test_a_road_that_rises_or_falls_is_followed(slope: float) -> None:
    range_m = 30.0
    bottom = HORIZON_PX + FOCAL_PX * (EYE_M - slope * range_m) / range_m
    u1, _, u2, _ = box_of(range_m)
    found = sight(seen((u1, bottom - 60.0, u2, bottom), range_m), points=road(slope=slope))
    assert found is not None
    assert abs(HEIGHT_RATIOS[int(np.abs(found.above).argmin())]) < 0.07


def test_a_lower_edge_above_the_horizon_fits_the_road_nowhere() -> None:
    found = sight(seen((600.0, 200.0, 680.0, 290.0), 40.0))
    assert found is not None
    assert (found.above > 0.0).all()
    assert found.above[0] > found.above[-1]


@settings(max_examples=100, deadline=None)
@given(
    st.floats(0.0, 1270.0), st.floats(0.0, 700.0), st.floats(0.5, 300.0), st.floats(10.0, 120.0), st.floats(0.0, 5.0)
)
@example(u=845.0, v=340.0, px=10.0, law_m=10.0, back_m=15.0)
def test_any_box_in_any_view_is_compared_with_numbers(
    u: float, v: float, px: float, law_m: float, back_m: float
) -> None:
    """Also at the edge of a very wide image, with the camera far behind the bumper."""
    K = np.array([[300.0, 0.0, MIDDLE_PX], [0.0, 300.0, HORIZON_PX], [0.0, 0.0, 1.0]])
    T_camera_ego = np.array([[0, -1, 0, 0], [0, 0, -1, EYE_M - 0.8], [1, 0, 0, back_m], [0, 0, 0, 1]], dtype=np.float64)
    wide = resolve(AlignmentParams(), CameraCalibration(K, np.zeros(5), T_camera_ego, 1280, 720))
    boxes = (seen((u, v, u + px, v + px), law_m),)
    found = measure_contacts(boxes, swept(), wide, FusionParams())
    assert found is not None
    if found[0].road is not None:
        height = hinted(BoxShape(), RoadContact().seen(found[0].road), 0.2)
        assert np.isfinite(height.mean)
        assert height.sigma is not None
        assert 0.0 < height.sigma < 1.0


NEARER = seen(box_of(15.0), 15.0)


@pytest.mark.parametrize(
    ("case", "boxes"),
    [
        ("its lower edge is behind a nearer vehicle", (seen(box_of(40.0), 40.0), NEARER)),
        ("no distance by its height", (seen(box_of(40.0), None),)),
        ("nearer than a height is learned", (seen(box_of(9.0), 9.0),)),
        ("no vehicle", (seen(box_of(40.0), 40.0, "person"),)),
        ("beside the road", (seen(box_of(30.0, y_m=9.0), 30.0),)),
    ],
)
def test_no_contact(case: str, boxes: tuple[VisionMeasurement, ...]) -> None:
    assert sight(*boxes) is None, case


def test_a_nearer_vehicle_beside_it_and_a_second_box_on_itself_hide_nothing() -> None:
    assert sight(seen(box_of(40.0), 40.0), seen(box_of(15.0, y_m=3.0), 15.0)) is not None
    u1, v1, u2, v2 = box_of(40.0)
    assert sight(seen((u1, v1, u2, v2), 40.0), seen((u1, v1 - 2.0, u2, v2 + 4.0), 36.0)) is not None


@pytest.mark.parametrize("range_m", [20.0, 40.0])
@pytest.mark.parametrize("turned_deg", [-0.3, 0.3])
def test_a_camera_that_is_turned_a_little_stays_within_its_sigma(range_m: float, turned_deg: float) -> None:
    u1, v1, u2, v2 = box_of(range_m)
    off = FOCAL_PX * np.radians(turned_deg)
    found = sight(seen((u1, v1 + off, u2, v2 + off), range_m))
    assert found is not None
    right = int(np.abs(HEIGHT_RATIOS).argmin())
    assert abs(found.above[right]) < 2.2 * found.lasting[right]


def test_without_what_it_rests_on_boxes_stay_as_they_are() -> None:
    boxes = (seen(box_of(40.0), 40.0),)
    params, angular = FusionParams(), Angular(0.001, 0.001, MIDDLE_PX, HORIZON_PX)
    assert measure_contacts(None, swept(), aligned(), params) is None
    assert measure_contacts(boxes, swept(road()[:10]), aligned(), params) == boxes
    assert measure_contacts(boxes, road_ahead(road(), None, boxes, aligned()), aligned(), params) == boxes
    assert measure_contacts(boxes, swept(), None, params) == boxes
    assert measure_contacts(boxes, swept(), angular, params) == boxes, "its rays do not start at the camera"
    assert measure_contacts(boxes, swept(), aligned(), FusionParams(use_ground_contact=False)) == boxes


def test_returns_on_a_vehicle_are_no_road() -> None:
    """Beyond a crest, a ring on the vehicle's rear lies where a flat road would be: the road is not measured there."""
    near = road()[road()[:, 0] < 12.0]
    rear = np.array([(28.0, y, -0.8, 0.0) for y in np.linspace(-0.9, 0.9, 15)], dtype=np.float32)
    points, vehicle = np.concatenate([near, rear]), seen(box_of(28.0), 28.0)
    lower = vehicle.detection.bbox[3]
    hanging = seen((*vehicle.detection.bbox[:3], lower + 20.0), 28.0)
    at = np.array([28.0])
    known, unknown = swept(points), swept(points, hanging)
    assert known is not None
    assert unknown is not None
    assert unknown.height_sigma_m(at)[0] > 2.0 * known.height_sigma_m(at)[0]
