"""The image of a turned camera shows every direction where that camera sees it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.alignment.projection import Pinhole
from pipeline.simulation.drawing.turned_view import margin_for, turned, with_margin
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.faults import Faults, Knock, most_turned_rad, true_camera
from pipeline.types import U8, CameraCalibration

FAULTS = {
    "left": Faults(camera_yaw_deg=2.0),
    "right and down": Faults(camera_yaw_deg=-1.0, camera_pitch_deg=1.5),
    "up and clockwise": Faults(camera_pitch_deg=-1.0, camera_roll_deg=3.0),
    "knocked": Faults(camera_yaw_deg=0.5, knock=Knock(at_s=1.0, yaw_deg=1.0, roll_deg=-2.0)),
    "all at their limits": Faults(camera_yaw_deg=5.0, camera_pitch_deg=5.0, camera_roll_deg=5.0),
}


def bearings(camera: CameraCalibration) -> U8:
    """What the camera sees of a sphere at infinity whose red and green are the tangents to the side and up."""
    v, u = np.mgrid[: camera.height, : camera.width]
    _, rays = Pinhole(camera.K, camera.distortion, camera.T_camera_ego).rays(np.column_stack([u.ravel(), v.ravel()]))
    image = np.zeros((camera.height * camera.width, 3))
    for channel, axis in ((2, 1), (1, 2)):
        image[:, channel] = 127.0 + 100.0 * rays[:, axis] / rays[:, 0]
    return np.clip(np.round(image), 0, 255).astype(np.uint8).reshape(camera.height, camera.width, 3)


@pytest.mark.parametrize("name", FAULTS)
def test_every_direction_is_where_the_turned_camera_sees_it(name: str) -> None:
    camera, faults = calibration(), FAULTS[name]
    actual = true_camera(camera, faults, t_s=2.0)
    margin = margin_for(camera, most_turned_rad(faults))
    shown = turned(bearings(with_margin(camera, margin)), camera, margin, actual).astype(int)
    wanted = bearings(actual).astype(int)
    assert np.abs(shown - wanted).max() <= 2
    assert np.abs(bearings(camera).astype(int) - wanted).max() > 2, "the calibrated camera sees something else"


def test_a_camera_that_is_not_turned_needs_no_margin() -> None:
    camera = calibration()
    assert margin_for(camera, most_turned_rad(Faults(lost_rings=(3,)))) == 0
    assert with_margin(camera, 0) is camera
