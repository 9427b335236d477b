"""Which track a box belongs to: the most likely one, which is not always the nearest in sigmas."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.params import VisionTrackingParams
from pipeline.types import Detection, VisionMeasurement
from pipeline.vision.association import Expected, match
from pipeline.vision.tracking import VisionTrackerState, track

NOISE_PX = 4.5


def expected(track_id: int, u: float, sigma_px: float, double_of: int | None = None) -> Expected:
    (shown,) = track(VisionTrackerState(track_id), (box(u),), None, VisionTrackingParams())[1]
    return Expected(replace(shown, hits=10), sigma_px, NOISE_PX, 0.1, double_of)


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
    """By the normalised error alone, the uncertain one would win: 2 px at σ = 40 against 8 px at σ = 5."""
    followed = [expected(1, 610.0, 5.0), expected(2, vague_at, 40.0)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {partner: 0}


@pytest.mark.parametrize(
    ("began_on", "partner"),
    [
        pytest.param(1, 0, id="began as a second box on it"),
        pytest.param(None, 1, id="another vehicle that came in front of it"),
        pytest.param(7, 1, id="the object it began on is gone"),
    ],
)
def test_the_only_box_is_the_vehicles_and_not_its_doubles(began_on: int | None, partner: int) -> None:
    followed = [expected(1, 610.0, 5.0), expected(2, 603.0, 5.0, began_on)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {partner: 0}


def test_an_object_that_has_left_the_one_it_began_on_is_no_double() -> None:
    followed = [expected(1, 610.0, 5.0), expected(2, 588.0, 5.0, double_of=1)]
    assert match(followed, [box(593.0)], VisionTrackingParams()) == {1: 0}


def test_a_vague_prediction_takes_what_nobody_else_wants() -> None:
    followed = [expected(1, 500.0, 5.0), expected(2, 610.0, 40.0)]
    assert match(followed, [box(602.0)], VisionTrackingParams()) == {1: 0}


def test_each_takes_its_own_where_both_boxes_are_there() -> None:
    followed = [expected(1, 610.0, 5.0), expected(2, 640.0, 40.0)]
    assert match(followed, [box(645.0), box(608.0)], VisionTrackingParams()) == {0: 1, 1: 0}
