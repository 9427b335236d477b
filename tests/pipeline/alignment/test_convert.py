"""Each model as the best fit of the other."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.alignment.convert import angular_of, costs, pinhole_of
from pipeline.alignment.projection import Angular, Pinhole, angular_from_calibration
from tests.pipeline.calibration.alignment.made_drive import CAMERA, ROAD_M, SIZE

PINHOLE = Pinhole(CAMERA.K, CAMERA.distortion, CAMERA.T_camera_ego)


def test_the_best_fit_is_nearer_than_the_model_of_the_middle():
    def mean_px(model: Angular) -> float:
        return float(np.mean([each.mean_px for each in costs(PINHOLE, model, *SIZE, ROAD_M)]))

    own, fitted = angular_from_calibration(CAMERA), angular_of(PINHOLE, CAMERA)
    assert mean_px(fitted) < 0.7 * mean_px(own)


def test_the_cost_grows_towards_the_sides():
    found = costs(PINHOLE, angular_from_calibration(CAMERA), *SIZE, ROAD_M)
    assert [each.from_deg for each in found][:2] == [0.0, 5.0]
    assert found[-1].mean_px > 3 * found[0].mean_px
    assert found[-1].mean_m > found[0].mean_m


def test_a_model_converted_to_itself_costs_nothing():
    for each in costs(PINHOLE, PINHOLE, *SIZE, ROAD_M):
        assert each.mean_px == pytest.approx(0.0, abs=1e-6)
        assert each.mean_m == pytest.approx(0.0, abs=1e-6)


def test_a_pinhole_camera_made_from_an_angular_model_agrees_with_it_ahead():
    angular = Angular(*np.radians([0.06, 0.065]), 650.0, 180.0)
    camera = pinhole_of(angular, *SIZE)
    found = costs(angular, Pinhole(camera.K, camera.distortion, camera.T_camera_ego), *SIZE, None)
    assert found[0].mean_px < 10.0
    again = angular_of(Pinhole(camera.K, camera.distortion, camera.T_camera_ego), camera)
    assert again.h_res_rad == pytest.approx(angular.h_res_rad, rel=0.02)
    assert (again.cx, again.cy) == pytest.approx((650.0, 180.0), abs=3.0)
