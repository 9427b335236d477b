"""What a working camera would have to see: images without a box on what the LiDAR tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.fusion.existence import ExistenceState, weigh
from pipeline.params import CipvParams, ExistenceParams
from pipeline.types import CameraCalibration, Frame, FusedObject, RawBoxes
from tests.pipeline.build import fused, moment
from tests.pipeline.fusion.ray_towards import FRAME, NOTHING, PARAMS, Rays

NO_RAYS = Rays(NOTHING)
LENS = np.array([[700.0, 0.0, 640.0], [0.0, 700.0, 360.0], [0.0, 0.0, 1.0]])
CAMERA = CameraCalibration(LENS, np.zeros(0), np.eye(4), 1280, 720)
NO_BOXES = RawBoxes("none", np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())
LOOKED = replace(FRAME, camera=CAMERA, raw_boxes=NO_BOXES)
WALL = replace(fused(1, 20.0, source="L"), bbox=(600.0, 300.0, 680.0, 380.0))
ASIDE_OF_IT = replace(fused(3, 15.0, 6.0, source="V"), bbox=(100.0, 280.0, 220.0, 400.0))
CAR_BEFORE_IT = replace(fused(2, 12.0, source="V"), bbox=(560.0, 280.0, 720.0, 420.0))


@pytest.mark.parametrize(
    ("frame", "others", "images", "exists"),
    [
        pytest.param(LOOKED, (ASIDE_OF_IT,), 5, False, id="the camera sees a car beside it, and none there"),
        pytest.param(LOOKED, (), 5, True, id="it sees nothing at all: it may be dark"),
        pytest.param(LOOKED, (ASIDE_OF_IT,), 2, True, id="it may have missed it twice"),
        pytest.param(FRAME, (ASIDE_OF_IT,), 5, True, id="no detector ran"),
        pytest.param(replace(LOOKED, camera=None), (ASIDE_OF_IT,), 5, True, id="no camera is known"),
        pytest.param(LOOKED, (CAR_BEFORE_IT,), 5, True, id="a car hides it"),
    ],
)
def test_what_a_working_camera_would_have_to_see(
    frame: Frame, others: tuple[FusedObject, ...], images: int, exists: bool
) -> None:
    assert (_probability(WALL, frame, others, images) > CipvParams().become_existence) == exists


@pytest.mark.parametrize(
    "item",
    [
        pytest.param(replace(WALL, bbox=(0.0, 300.0, 80.0, 380.0)), id="cut by the edge of the image"),
        pytest.param(replace(fused(1, 45.0, source="L"), bbox=WALL.bbox), id="too far"),
        pytest.param(replace(WALL, source="VL", label="car", score=0.6), id="boxed before"),
    ],
)
def test_what_the_camera_cannot_know_is_no_evidence(item: FusedObject) -> None:
    assert _probability(item, LOOKED, (ASIDE_OF_IT,), 5) > 0.9


def test_a_wide_lens_knows_less_far() -> None:
    """At 20 m, a car is 19 pixels high through it."""
    wide = replace(CAMERA, K=LENS @ np.diag([0.36, 0.36, 1.0]))
    assert _probability(WALL, replace(LOOKED, camera=wide), (ASIDE_OF_IT,), 5) > 0.9
    assert (
        _probability(
            replace(fused(1, 14.0, source="L"), bbox=WALL.bbox), replace(LOOKED, camera=wide), (ASIDE_OF_IT,), 5
        )
        < 0.7
    )


def test_missing_boxes_are_shown_and_can_be_left_out() -> None:
    said = _told(WALL, LOOKED, (ASIDE_OF_IT,), 5, PARAMS)
    assert [(each.value, each.passed) for each in said.gates if each.name == "images_without_box"] == [(3, False)]
    without = _told(WALL, LOOKED, (ASIDE_OF_IT,), 5, ExistenceParams(use_missing_boxes=False))
    assert (without.existence or 0.0) > 0.9
    assert not [each for each in without.gates if each.name == "images_without_box"]


def _probability(item: FusedObject, frame: Frame, others: tuple[FusedObject, ...], images: int) -> float:
    return _told(item, frame, others, images, PARAMS).existence or 0.0


def _told(
    item: FusedObject, frame: Frame, others: tuple[FusedObject, ...], images: int, params: ExistenceParams
) -> FusedObject:
    """The object after this many sweeps with an image each."""
    state = ExistenceState()
    for k in range(images):
        state, found = weigh(state, (item, *others), NO_RAYS, frame, moment(None, 0.1 if k else None), params)
    return found[0]
