"""Which track a box belongs to: the most likely one, which is not always the nearest in sigmas."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.params import VisionTrackingParams
from pipeline.types import Detection, VisionMeasurement
from pipeline.vision.association import Expected, match
from pipeline.vision.tracking import VisionTrackerState, track

NOISE_PX = 4.5


def expected(track_id: int, u: float, sigma_px: float, hits: int = 10) -> Expected:
    (shown,) = track(VisionTrackerState(track_id), (box(u),), None, VisionTrackingParams())[1]
    return Expected(replace(shown, hits=hits), sigma_px, NOISE_PX, 0.1)


def box(u: float, size_px: float = 30.0) -> VisionMeasurement:
    half = size_px / 2
    return VisionMeasurement(Detection((u - half, 180.0 - half, u + half, 180.0 + half), "car", 0.8), None, None, None)


@pytest.mark.parametrize(
    ("vague_at", "partner"),
    [
        pytest.param(602.0, 0, id="a little beside the sure one, right at the vague one: the sure one's"),
        pytest.param(622.0, 0, id="the vague one is elsewhere"),
    ],
)
def test_a_vague_prediction_does_not_outbid_a_sure_one(vague_at: float, partner: int) -> None:
    """By surprise alone the vague one would win: 2 px of 40 against 8 px of 5."""
    followed = [expected(1, 610.0, 5.0), expected(2, vague_at, 40.0)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {partner: 0}


def test_a_second_box_on_a_vehicle_does_not_take_over_its_number() -> None:
    followed = [expected(1, 610.0, 5.0), expected(2, 603.0, 5.0, hits=1)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {0: 0}


def test_a_vague_prediction_takes_what_nobody_else_wants() -> None:
    followed = [expected(1, 500.0, 5.0), expected(2, 610.0, 40.0)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {1: 0}


def test_each_takes_its_own_where_both_boxes_are_there() -> None:
    followed = [expected(1, 610.0, 5.0), expected(2, 640.0, 40.0)]
    assert match(followed, [box(645.0), box(608.0)], VisionTrackingParams()) == {0: 1, 1: 0}
