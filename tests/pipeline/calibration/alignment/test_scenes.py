"""What a fit keeps of a frame: clusters that may be vehicles, and where they could end."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibration.alignment.scenes import ENDS, fit_scene
from pipeline.params import Params
from pipeline.types import Frame, RawBoxes, Sweep
from tests.app.engine.recording_helpers import Recording

ROAD_M = -1.5


def frame(width_m: float = 1.8, height_m: float = 1.5, ahead_m: float = 15.0) -> Frame:
    """A flat road with a wall, scanned by rings 2° apart in steps of 0.2°, and on the left a house that all rings
    hit."""
    azimuth = np.radians(np.arange(-40.0, 40.0, 0.2))
    points, rings = [], []
    for ring, elevation in enumerate(np.radians(np.arange(-15.0, 16.0, 2.0))):
        on_road = ROAD_M / np.tan(elevation) if elevation < 0 else np.inf
        at_wall = ahead_m / np.cos(azimuth)
        is_wall = (np.abs(ahead_m * np.tan(azimuth)) < width_m / 2) & (at_wall < on_road)
        is_wall &= at_wall * np.tan(elevation) < ROAD_M + height_m
        range_m = np.where(is_wall, at_wall, on_road)
        range_m = np.where((azimuth > np.radians(35.0)) & (on_road > 70.0), 70.0, range_m)
        seen = range_m < 80.0
        r, a = range_m[seen], azimuth[seen]
        points.append(np.column_stack([r * np.cos(a), r * np.sin(a), r * np.tan(elevation), np.full(len(r), 30.0)]))
        rings.append(np.full(len(r), ring, np.uint8))
    sweep = Sweep(0, np.vstack(points).astype(np.float32), np.concatenate(rings), 16)
    boxes = np.array([[100, 60, 200, 120], [10, 10, 50, 50], [0, 60, 90, 179]], np.float32)
    raw = RawBoxes("made", boxes, np.array([0.9, 0.2, 0.6], np.float32), ("car", "car", "truck"))
    like = Recording().frame(0)
    return Frame(0, "0", 0, sweep, like.image, like.camera, raw_boxes=raw)


def test_a_car_ends_between_its_last_beam_and_the_next_one():
    scene = fit_scene(frame(), Params())
    assert scene is not None
    assert len(scene.outline) == 1
    right, left, top, bottom = scene.outline[0, :ENDS]
    assert left[1] == pytest.approx(0.9, abs=0.06)
    assert right[1] == pytest.approx(-0.9, abs=0.06)
    assert bottom[2] > ROAD_M
    assert top[2] <= 0.0 <= scene.roof[0, 2], "its roof, 0 m above the sensor, is between two rings"
    assert scene.foot[0, :, 2] == pytest.approx(ROAD_M, abs=0.05)
    assert scene.range_m == pytest.approx(15.0, abs=0.1)


def test_boxes_of_low_scores_are_left_out_and_cut_edges_known():
    scene = fit_scene(frame(), Params())
    assert scene is not None
    assert scene.boxes[:, 0].tolist() == [100.0, 0.0]
    assert scene.whole.tolist() == [[True] * 4, [False, True, True, False]]


@pytest.mark.parametrize("seen", [frame(width_m=25.0), frame(ahead_m=65.0), frame(height_m=0.3)], ids=str)
def test_walls_kerbs_and_far_things_are_no_vehicles(seen: Frame):
    assert fit_scene(seen, Params()) is None


def test_what_goes_on_above_the_clustered_height_has_no_roof():
    scene = fit_scene(frame(height_m=8.0), Params())
    assert scene is not None
    assert np.isnan(scene.roof[0]).all()


def test_a_frame_without_a_detector_is_none():
    assert fit_scene(Recording().frame(0), Params()) is None
