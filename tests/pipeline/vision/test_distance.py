from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.alignment.projection import Angular, Pinhole
from pipeline.common.geometry import transform
from pipeline.params import DistanceParams, preset
from pipeline.types import Box, CameraCalibration, Detection
from pipeline.vision.distance import PowerLaw, binned, fit_power_law, measure

FOCAL_PX = 907.0
CAR_M = 1444.0 / FOCAL_PX
"""Height of the car assumed by the default law."""


def _camera(focal_px: float = FOCAL_PX, mount: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> CameraCalibration:
    """A level camera at ``mount`` that faces along ego x."""
    axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = axes, -axes @ np.array(mount)
    K = np.array([[focal_px, 0.0, 640.0], [0.0, focal_px, 360.0], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.zeros(0), T, 1280, 720)


def _pinhole(camera: CameraCalibration) -> Pinhole:
    return Pinhole(camera.K, camera.distortion, camera.T_camera_ego)


def _seen(camera: CameraCalibration, x: float, y: float, height_m: float = CAR_M, label: str = "car") -> Detection:
    """The box of a flat car facing the camera, its middle at the camera's height, by the camera's own equation."""
    u, v = _pinhole(camera).project(np.array([[x, y, 0.0]]))[0]
    depth = transform(camera.T_camera_ego, np.array([[x, y, 0.0]]))[0, 2]
    half_h, half_w = camera.K[1, 1] * height_m / depth / 2, camera.K[0, 0] * 0.9 / depth
    return Detection((u - half_w, v - half_h, u + half_w, v + half_h), label, 0.9)


def _one(detection: Detection, camera: CameraCalibration | None, **changes: object):  # type: ignore[no-untyped-def]
    alignment = _pinhole(camera) if camera is not None else None
    return measure((detection,), alignment, camera, DistanceParams(**changes))[0]


@given(st.floats(8.0, 100.0), st.floats(-0.5, 0.5), st.floats(600.0, 2000.0), st.tuples(*[st.floats(-1.0, 1.0)] * 2))
def test_a_car_is_placed_where_it_stands(x: float, slope: float, focal: float, mount: tuple[float, float]) -> None:
    """For any focal length, bearing and mount: the law is that of a pinhole camera, and the car has the assumed
    height."""
    camera = _camera(focal, (*mount, 0.0))
    seen = _one(_seen(camera, x, slope * x), camera, max_m=200.0)
    assert seen.distance_m == pytest.approx(math.hypot(x, slope * x), rel=1e-6)
    assert seen.position == pytest.approx((x, slope * x), rel=1e-6, abs=1e-6)


def test_depth_taken_for_range_is_a_fifth_short_at_35_degrees() -> None:
    """Slip of the print: without ``depth_along_axis`` the error is 1/cos 35° = 22 %."""
    camera, y = _camera(), 20.0 * math.tan(math.radians(35.0))
    detection = _seen(camera, 20.0, -y)
    printed = _one(detection, camera, depth_along_axis=False).distance_m
    assert _one(detection, camera).distance_m / printed == pytest.approx(1.22, abs=0.005)
    assert printed == pytest.approx(20.0)


def test_the_printed_law() -> None:
    paper = preset("paper").distance.model_copy(update={"binning": False})
    box = Detection((600, 300, 700, 300 + 57.8), "car", 0.9)
    assert measure((box,), None, None, paper)[0].distance_m == pytest.approx(1829.1 * 57.8**-1.093)
    binned_box = measure((box,), None, None, preset("paper").distance)[0]
    assert binned_box.distance_m == 20.0
    assert binned_box.position is None


@pytest.mark.parametrize(
    ("distance_m", "expected"),
    [(4.9, None), (5.0, 10.0), (14.9, 10.0), (15.0, 20.0), (55.0, 60.0), (60.0, 60.0), (60.1, None), (math.nan, None)],
)
def test_bins(distance_m: float, expected: float | None) -> None:
    assert binned(distance_m) == expected


@pytest.mark.parametrize(
    ("label", "ratio"), [("car", 1.0), ("truck", 1.6), ("bus", 2.0), ("motorcycle", 0.75), ("person", None)]
)
def test_a_law_for_each_class(label: str, ratio: float | None) -> None:
    camera = _camera()
    seen = _one(_seen(camera, 30.0, 2.0, CAR_M * (ratio or 1.0), label), camera)
    if ratio is None:
        assert (seen.distance_m, seen.sigma_m, seen.position) == (None, None, None)
    else:
        assert seen.distance_m == pytest.approx(math.hypot(30.0, 2.0), rel=1e-6)


def test_in_print_only_cars_have_a_distance() -> None:
    camera = _camera()
    assert _one(_seen(camera, 30.0, 0.0, label="truck"), camera, per_class=False).distance_m is None
    assert _one(_seen(camera, 30.0, 0.0), camera, per_class=False).distance_m is not None


@pytest.mark.parametrize(
    ("box", "known"),
    [
        ((600.0, 0.0, 700.0, 300.0), False),
        ((600.0, 400.0, 700.0, 719.6), False),
        ((400.0, 12.0, 1100.0, 709.0), False),
        ((0.0, 300.0, 80.0, 360.0), True),
        ((600.0, 300.0, 700.0, 360.0), True),
        ((600.0, 300.0, 700.0, 300.0), False),
        ((600.0, 300.0, 700.0, 305.0), False),
    ],
    ids=[
        "cut above",
        "cut below",
        "filling the image but for a network's error",
        "cut at the side",
        "whole",
        "no height",
        "beyond reach",
    ],
)
def test_a_box_that_tells_no_distance_keeps_its_row(box: tuple[float, float, float, float], known: bool) -> None:
    seen = _one(Detection(box, "car", 0.9), _camera())
    assert seen.detection.bbox == box
    assert [value is not None for value in (seen.distance_m, seen.sigma_m, seen.position)] == [known] * 3


def test_sigma_is_the_laws_slope_and_the_spread_of_sizes() -> None:
    """At 60 m, one pixel more or less changes the estimate by the sigma for one pixel of noise."""
    camera = _camera()
    detection = _seen(camera, 60.0, 0.0)
    x1, y1, x2, y2 = detection.bbox
    taller = Detection((x1, y1 - 0.5, x2, y2 + 0.5), "car", 0.9)
    moved = _one(detection, camera).distance_m - _one(taller, camera).distance_m
    assert _one(detection, camera, height_sigma_px=1.0, size_spread=0.0).sigma_m == pytest.approx(moved, rel=0.05)
    assert _one(detection, camera, height_sigma_px=0.2, size_spread=0.2).sigma_m == pytest.approx(12.0, rel=0.01)


def test_the_angular_model_brings_its_own_focal_length() -> None:
    alignment = Angular(1 / FOCAL_PX / 2, 1 / FOCAL_PX / 2, 640.0, 360.0)
    box = Detection((600.0, 300.0, 680.0, 420.0), "car", 0.9)
    seen = measure((box,), alignment, None, DistanceParams())[0]
    assert seen.distance_m == pytest.approx(1444.0 / 60.0)
    assert seen.position == pytest.approx((seen.distance_m, 0.0))


@pytest.mark.parametrize(
    ("case", "box", "other", "known"),
    [
        ("whole", (600.0, 300.0, 640.0, 330.0), None, True),
        ("cut by the left edge", (0.5, 300.0, 40.0, 330.0), None, False),
        ("cut by the right edge", (1240.0, 300.0, 1279.5, 330.0), None, False),
        ("behind a nearer one", (600.0, 300.0, 640.0, 330.0), (630.0, 290.0, 700.0, 350.0), False),
        ("before a farther one", (600.0, 300.0, 640.0, 330.0), (630.0, 290.0, 700.0, 325.0), True),
        ("beside a nearer one", (600.0, 300.0, 640.0, 330.0), (650.0, 290.0, 700.0, 350.0), True),
    ],
)
def test_the_aspect_is_that_of_boxes_that_show_the_whole_width(
    case: str, box: Box, other: Box | None, known: bool
) -> None:
    camera = _camera()
    boxes = tuple(Detection(each, "car", 0.9) for each in (box, other) if each is not None)
    aspect = measure(boxes, _pinhole(camera), camera, DistanceParams())[0].aspect
    assert aspect == (pytest.approx(math.log(30 / (box[2] - box[0]))) if known else None), case


def test_order_and_number_are_kept() -> None:
    camera = _camera()
    detections = tuple(
        _seen(camera, x, 0.0, label=label) for x, label in [(50.0, "car"), (20.0, "person"), (10.0, "car")]
    )
    measured = measure(detections, _pinhole(camera), camera, DistanceParams())
    assert tuple(m.detection for m in measured) == detections
    assert measure((), _pinhole(camera), camera, DistanceParams()) == ()


@given(st.floats(200.0, 5000.0), st.floats(-1.6, -0.7))
def test_a_law_is_found_again(coefficient: float, exponent: float) -> None:
    heights = np.linspace(15.0, 300.0, 40)
    law = fit_power_law(heights, PowerLaw(coefficient, exponent)(1.0) * heights**exponent)
    assert (law.coefficient, law.exponent) == pytest.approx((coefficient, exponent), rel=1e-6)


def test_a_few_wrong_pairs_do_not_turn_the_law() -> None:
    rng = np.random.default_rng(3)
    heights = np.sort(rng.uniform(20.0, 250.0, 60))
    distances = 1500.0 / heights * np.exp(rng.normal(0.0, 0.03, 60))
    distances[:4] *= 3.0
    law = fit_power_law(heights, distances)
    plain = np.polyfit(np.log(heights), np.log(distances), 1)[0]
    assert abs(law.exponent + 1.0) < 0.03
    assert abs(plain + 1.0) > 0.1
    assert fit_power_law(heights, distances, exponent=-1.0).coefficient == pytest.approx(1500.0, rel=0.02)


@pytest.mark.parametrize(
    ("heights", "distances", "complaint"),
    [
        ([], [], "at least 2"),
        ([50.0], [30.0], "at least 2"),
        ([50.0, 50.0], [30.0, 31.0], "at least 2"),
        ([50.0, 0.0], [30.0, 31.0], "positive"),
        ([50.0, 60.0], [30.0, -1.0], "positive"),
        ([50.0, math.nan], [30.0, 31.0], "positive"),
        ([50.0, 60.0], [30.0], "2 heights but 1 distances"),
    ],
)
def test_a_law_cannot_be_fitted_to(heights: list[float], distances: list[float], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        fit_power_law(heights, distances)
