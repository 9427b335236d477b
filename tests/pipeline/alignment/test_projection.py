"""Projecting a point and coming back gives the point, with either model; and the two agree where they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.alignment.projection import (
    Angular,
    Pinhole,
    angular_from_calibration,
    pixels_per_radian,
    project_cuboid,
    resolve,
)
from pipeline.common.geometry import Cuboid
from pipeline.params import AlignmentParams
from pipeline.types import CameraCalibration

LOOKS_ALONG_X = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Camera axes (x right, y down, z ahead) from ego axes."""


def camera(
    mount_m: tuple[float, float, float] = (0.0, 0.0, 0.0), distortion: tuple[float, ...] = ()
) -> CameraCalibration:
    T = np.eye(4)
    T[:3, :3] = LOOKS_ALONG_X
    T[:3, 3] = -LOOKS_ALONG_X @ np.array(mount_m)
    K = np.array([[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.array(distortion), T, 1280, 720)


def pinhole(calibration: CameraCalibration) -> Pinhole:
    return Pinhole(calibration.K, calibration.distortion, calibration.T_camera_ego)


MODELS = {
    "angular": Angular(np.radians(0.06), np.radians(0.05), 640.0, 360.0),
    "pinhole": pinhole(camera()),
    "pinhole mounted elsewhere": pinhole(camera((-1.6, 0.2, 0.9))),
    "pinhole with distortion": pinhole(camera((-1.6, 0.2, 0.9), (-0.05, 0.01, 0.0005, -0.0005))),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
@given(range_m=st.floats(3.0, 100.0), bearing=st.floats(-0.6, 0.6), height=st.floats(-2.0, 3.0))
def test_unproject_undoes_project(model: Angular | Pinhole, range_m: float, bearing: float, height: float) -> None:
    point = np.array([[range_m * np.cos(bearing), range_m * np.sin(bearing), height]])
    back = model.unproject(model.project(point), np.array([range_m]))
    assert back == pytest.approx(point, abs=0.02 if getattr(model, "distortion", np.zeros(0)).size else 1e-6)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_left_is_left_and_up_is_up(model: Angular | Pinhole) -> None:
    straight, left, high = model.project(np.array([[20.0, 0.0, 0.0], [20.0, 2.0, 0.0], [20.0, 0.0, 2.0]]))
    assert left[0] < straight[0]
    assert high[1] < straight[1]


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_no_points_are_no_pixels(model: Angular | Pinhole) -> None:
    assert model.project(np.zeros((0, 3))).shape == (0, 2)
    assert model.unproject(np.zeros((0, 2)), np.zeros(0)).shape == (0, 3)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_behind_the_camera_is_nowhere(model: Angular | Pinhole) -> None:
    assert np.isnan(model.project(np.array([[-5.0, 0.3, 0.0]]))).all()


def test_inverse_printed_in_the_paper_is_wrong() -> None:
    """y = x_img·tan(x_img·h_res) would put a car 3 m to the left of a 20 m range hundreds of metres away."""
    model = MODELS["angular"]
    assert isinstance(model, Angular)
    ((u, v),) = model.project(np.array([[np.sqrt(400 - 9), 3.0, 0.0]]))
    printed = (u - model.cx) * np.tan((u - model.cx) * model.h_res_rad)
    ours = model.unproject(np.array([[u, v]]), np.array([20.0]))[0, 1]
    assert ours == pytest.approx(3.0)
    assert abs(printed - 3.0) > 10.0


def test_larger_h_res_narrows_the_gap_between_points() -> None:
    """The paper's text says the opposite; x_img = angle / h_res."""
    points = np.array([[20.0, 1.0, 0.0], [20.0, -1.0, 0.0]])
    fine, coarse = (Angular(np.radians(h), np.radians(0.05), 640, 360).project(points) for h in (0.05, 0.10))
    assert coarse[1, 0] - coarse[0, 0] == pytest.approx((fine[1, 0] - fine[0, 0]) / 2)


def test_angular_agrees_with_pinhole_at_the_centre_and_not_at_the_edge() -> None:
    calibration = camera()
    angular, exact = angular_from_calibration(calibration), pinhole(calibration)
    near_axis, near_edge = np.array([[50.0, 1.0, -0.5]]), np.array([[50.0, 33.0, -0.5]])
    assert np.hypot(*(angular.project(near_axis) - exact.project(near_axis))[0]) < 0.1
    assert np.hypot(*(angular.project(near_edge) - exact.project(near_edge))[0]) > 40.0


def test_sliders_override_only_what_they_set() -> None:
    calibration = camera()
    untouched = resolve(AlignmentParams(model="angular"), calibration)
    moved = resolve(AlignmentParams(model="angular", cx_px=700.0), calibration)
    assert isinstance(untouched, Angular)
    assert isinstance(moved, Angular)
    assert (moved.cx, moved.cy, moved.h_res_rad) == (700.0, untouched.cy, untouched.h_res_rad)


@pytest.mark.parametrize(
    ("params", "calibration", "expected"),
    [
        pytest.param(AlignmentParams(), None, type(None), id="nothing known"),
        pytest.param(AlignmentParams(model="angular", h_res_deg=0.1), None, type(None), id="half known"),
        pytest.param(
            AlignmentParams(model="angular", h_res_deg=0.1, v_res_deg=0.1, cx_px=1.0, cy_px=2.0),
            None,
            Angular,
            id="typed by a person",
        ),
        pytest.param(AlignmentParams(), camera(), Pinhole, id="calibrated"),
    ],
)
def test_what_is_in_use(params: AlignmentParams, calibration: CameraCalibration | None, expected: type) -> None:
    assert isinstance(resolve(params, calibration), expected)


def test_pinhole_correction_turns_the_way_its_name_says() -> None:
    """A mount corrected to the left sees a fixed point further right; corrected downwards, further up."""
    point = np.array([[30.0, 0.0, 0.0]])
    base, yawed, pitched = (
        resolve(AlignmentParams(**angles), camera()).project(point)[0]  # type: ignore[union-attr]
        for angles in ({}, {"yaw_deg": 1.0}, {"pitch_deg": 1.0})
    )
    assert yawed[0] > base[0] + 10
    assert pitched[1] < base[1] - 10


def test_a_correction_turns_the_camera_where_it_is_mounted() -> None:
    """A point right before the lens of a camera 1.6 m behind the origin stays there, whatever the turn."""
    calibration = camera((-1.6, 0.2, 0.9))
    aligned = resolve(AlignmentParams(yaw_deg=10.0), calibration)
    assert aligned is not None
    turned = np.array([-1.6 + 5.0 * np.cos(np.radians(10)), 0.2 + 5.0 * np.sin(np.radians(10)), 0.9])
    assert aligned.project(turned[None])[0] == pytest.approx([640.0, 360.0], abs=1e-6)


@pytest.mark.parametrize(
    ("center", "visible"),
    [
        pytest.param((20.0, 0.0, 0.0), True, id="ahead"),
        pytest.param((-20.0, 0.0, 0.0), False, id="behind"),
        pytest.param((10.0, 40.0, 0.0), False, id="far to the side"),
    ],
)
def test_cuboid_box(center: tuple[float, float, float], visible: bool) -> None:
    calibration = camera()
    box = project_cuboid(pinhole(calibration), Cuboid(center, (4.0, 1.8, 1.5), 0.0).corners(), 1280, 720)
    assert (box is not None) == visible
    if box is not None:
        assert box == pytest.approx((595.0, 322.5, 684.9, 397.5), abs=15.0)
        assert 0 <= box[0] < box[2] <= 1280
        assert 0 <= box[1] < box[3] <= 720


@pytest.mark.parametrize("name", MODELS)
def test_a_left_turn_moves_what_is_far_ahead_to_the_right(name: str) -> None:
    model, turn_rad = MODELS[name], np.radians(0.1)
    far = 1e6 * np.array([[1.0, 0.0, 0.0], [np.cos(turn_rad), -np.sin(turn_rad), 0.0]])
    before, after = model.project(far)[:, 0]
    assert after > before
    assert (after - before) / turn_rad == pytest.approx(pixels_per_radian(model), rel=2e-3)


def test_a_camera_that_looks_back_shows_nothing_ahead() -> None:
    back = camera()
    back.T_camera_ego[:3, :3] = LOOKS_ALONG_X @ np.diag([-1.0, -1.0, 1.0])
    assert pixels_per_radian(pinhole(back)) is None
