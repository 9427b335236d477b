"""Image boxes that follow their cuboids, and those that somebody set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid, iou_matrix
from pipeline.labels.boxes import following
from pipeline.labels.model import LabelTrack, Origin, Sighting
from tests.pipeline.labels.formats.sets import camera, drive

BY = Origin("person", "Ada", 1)
CAR = Cuboid((20.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.1)
BESIDE = Cuboid((4.5, 3.0, 0.5), (4.0, 1.8, 1.5), 0.0)
"""Near, and cut by the left edge of the image."""


def sighting(cuboid: Cuboid | None, **more: object) -> Sighting:
    """The sighting in a track's only frame, as passed to an export."""
    here = drive()
    track = LabelTrack(1, "car", (Sighting(0, cuboid, **more),), "accepted", BY)  # type: ignore[arg-type]
    return following(replace(here.empty(), tracks=(track,)), here).tracks[0].sightings[0]


def around(cuboid: Cuboid) -> tuple[float, ...] | None:
    """The box around the corners, computed here; None outside the image."""
    eye = camera()
    seen = eye.T_camera_ego @ np.column_stack([cuboid.corners(), np.ones(8)]).T
    u, v = (eye.K @ seen[:3])[:2] / seen[2]
    x1, x2 = np.clip([u.min(), u.max()], 0.0, eye.width)
    y1, y2 = np.clip([v.min(), v.max()], 0.0, eye.height)
    return (x1, y1, x2, y2) if x1 < x2 and y1 < y2 else None


def test_a_detectors_box_gives_way_to_the_cuboids_projection() -> None:
    """Of 200 cuboids in all directions, those in the image get the box around their corners, cut at its edges."""
    rng = np.random.default_rng(3)
    cuboids = [
        Cuboid((float(x), float(y), 0.5), (4.0, 1.8, 1.5), float(yaw))
        for x, y, yaw in rng.uniform((6.0, -20.0, -3.0), (70.0, 20.0, 3.0), (200, 3))
    ]
    pairs = [(sighting(each, bbox=(1.0, 2.0, 30.0, 40.0)).bbox, around(each)) for each in cuboids]
    seen = [(one, other) for one, other in pairs if other is not None]
    assert len(seen) > 100
    overlaps = [iou_matrix(np.array([one]), np.array([other]))[0, 0] for one, other in seen]
    assert np.mean(np.array(overlaps) >= 0.9) >= 0.95
    assert all(one is None for one, other in pairs if other is None), "outside the image nothing has a box"


def test_a_box_that_was_set_stays() -> None:
    box = (500.0, 300.0, 700.0, 420.0)
    assert sighting(CAR, bbox=box, box_set=True).bbox == box
    assert sighting(None, bbox=box).bbox == box, "what the image alone shows has nothing to follow"


def test_how_much_is_cut_off_is_computed_unless_it_was_read() -> None:
    assert sighting(CAR).truncation == pytest.approx(0.0)
    cut = sighting(BESIDE)
    assert cut.bbox is not None
    assert cut.bbox[0] == 0.0
    assert 0.2 < (cut.truncation or 0.0) < 0.9
    assert sighting(BESIDE, truncation=0.5).truncation == 0.5
