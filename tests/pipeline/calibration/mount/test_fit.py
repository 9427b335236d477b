"""Yaw comes from driving straight, the axle from bends, the rest from the road; what is not told is not given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import Pinhole
from pipeline.calibration.mount.fit import MountFit, NoMount, fit_mount, mount_sentence, turned
from pipeline.calibration.mount.observe import MountRecord, Piece, RoadPlane
from pipeline.common.geometry import rotation, transform
from tests.pipeline.calibration.alignment.made_drive import CAMERA

YAW, AHEAD, LEFT, SCALE = np.radians(1.4), 2.3, 0.4, 0.98


def record(bends: float = 0.2, pieces: int = 80, roads: int = 80, noise_m: float = 0.02) -> MountRecord:
    """bends: standard deviation of the car's rotation per segment, rad."""
    rng = np.random.default_rng(3)
    way = []
    for k in range(pieces):
        driven, turn = rng.uniform(3.0, 5.0), rng.normal(0.0, bends)
        along, aside = rng.normal((SCALE * driven - LEFT * turn, AHEAD * turn), noise_m)
        way.append(
            Piece(k * 400_000_000, along + aside * YAW, aside - along * YAW, 0.0, turn, driven if k % 10 else None)
        )
    slopes = rng.normal(np.tan(np.radians([2.0, -3.0])), 0.004, (roads, 2))
    below = tuple(RoadPlane(k * 400_000_000, *slope, rng.normal(0.52, 0.01)) for k, slope in enumerate(slopes.tolist()))
    return MountRecord(max(pieces, roads), below, tuple(way))


def test_every_value_is_found_within_its_deviation():
    fit = fit_mount(record())
    true = {"yaw_deg": 1.4, "ahead_of_axle_m": AHEAD, "left_of_axle_m": LEFT}
    true |= {"pitch_deg": 2.0, "roll_deg": 3.0, "height_m": 0.52}
    assert set(fit.values) == set(true)
    for name, value in true.items():
        assert abs(fit.values[name] - value) < 3.0 * fit.sigmas[name], name
        assert abs(fit.values[name] - value) < (0.2 if name.endswith("_deg") else 0.1), name
    assert fit.speed_scale == pytest.approx(SCALE, abs=0.01)
    assert fit.warnings == ()
    assert "80 frames" in mount_sentence(fit)


def test_a_straight_drive_has_a_yaw_and_no_axle():
    fit = fit_mount(record(bends=0.0005))
    assert fit.values["yaw_deg"] == pytest.approx(1.4, abs=0.1)
    assert not {"ahead_of_axle_m", "left_of_axle_m"} & set(fit.values)
    assert any("straight" in each for each in fit.warnings)


def test_a_car_that_stands_has_no_yaw():
    fit = fit_mount(record(pieces=2))
    assert set(fit.values) == {"pitch_deg", "roll_deg", "height_m"}
    assert any("no yaw" in each for each in fit.warnings)
    with pytest.raises(NoMount, match=r"road is seen in 3.*no yaw"):
        fit_mount(record(pieces=2, roads=3))


def test_some_wrong_pieces_do_not_matter_and_noise_is_said():
    good = record()
    wrong = tuple(replace(each, left_m=each.left_m + 3.0) if k % 9 == 0 else each for k, each in enumerate(good.pieces))
    fit = fit_mount(replace(good, pieces=wrong))
    assert fit.values["yaw_deg"] == pytest.approx(1.4, abs=0.3)
    vague = fit_mount(record(noise_m=0.5))
    assert vague.sigmas["yaw_deg"] > 0.3
    assert any(each.startswith("yaw is known only to ±") for each in vague.warnings)


def test_the_rig_turns_as_a_whole():
    fit = MountFit({"yaw_deg": 3.0, "pitch_deg": -2.0, "roll_deg": 1.0}, {}, 1, 1.0, None)
    T_ego_lidar = np.eye(4)
    T_ego_lidar[:3, 3] = 0.1, 0.2, 0.3
    camera, T_car_lidar = turned(fit, T_ego_lidar, CAMERA)
    assert camera is not None
    points = np.array([[12.0, 1.0, -0.4], [30.0, -4.0, 1.0]])
    before = Pinhole(CAMERA.K, CAMERA.distortion, CAMERA.T_camera_ego).project(transform(T_ego_lidar, points))
    after = Pinhole(camera.K, camera.distortion, camera.T_camera_ego).project(transform(T_car_lidar, points))
    assert after == pytest.approx(before, abs=1e-6)
    assert T_car_lidar[:3, :3] == pytest.approx(rotation(*np.radians([1.0, -2.0, 3.0])))
