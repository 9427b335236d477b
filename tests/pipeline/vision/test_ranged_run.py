"""What a series of LiDAR ranges tells of a speed that wandering boxes leave open."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.params import VisionTrackingParams
from pipeline.types import Detection, VisionMeasurement
from pipeline.vision.ranged_run import RangedRun
from pipeline.vision.tracking import VisionTrackerState, track

BOXES_MPS = 4.0


def run(*ranged: bool, dt_s: float = 0.1) -> RangedRun:
    """The run after these distances, one every ``dt_s``; True: by returns."""
    found = RangedRun()
    for each in ranged:
        found = found.then(0.5 if each else None, dt_s)
    return found


@pytest.mark.parametrize(
    ("distances", "count", "lasts_s"),
    [
        pytest.param([], 0, 0.0, id="none"),
        pytest.param([False] * 5, 0, 0.0, id="boxes alone"),
        pytest.param([True], 1, 0.0, id="one"),
        pytest.param([True] * 6, 6, 0.5, id="six in a row"),
        pytest.param([True, True, False, False, True], 3, 0.4, id="a short gap"),
        pytest.param([True] * 6 + [False] * 6, 0, 0.0, id="a long gap ends it"),
        pytest.param([True] * 6 + [False] * 6 + [True], 1, 0.0, id="and the next one begins anew"),
    ],
)
def test_a_run_lasts_while_returns_keep_coming(distances: list[bool], count: int, lasts_s: float) -> None:
    found = run(*distances)
    assert found.ranges == count
    assert found.lasts_s == pytest.approx(lasts_s)


def test_the_longer_the_run_the_less_the_boxes_matter() -> None:
    left = [run(*[True] * n).wander_mps(BOXES_MPS) for n in range(1, 16)]
    assert left[:2] == [BOXES_MPS, BOXES_MPS], "two ranges fit any speed"
    assert all(b < a for a, b in pairwise(left[1:]))
    assert left[-1] < 0.1 * BOXES_MPS


def test_it_is_as_sure_as_a_line_through_the_ranges() -> None:
    """Lines fitted to noisy ranges of a standing object have speeds with that standard deviation."""
    rng, t = np.random.default_rng(0), np.arange(8) * 0.1
    slopes = np.polyfit(t, rng.normal(0.0, 0.5, (8, 4000)), 1)[0]
    assert run(*[True] * 8).wander_mps(1e6) == pytest.approx(slopes.std(), rel=0.15)


def test_a_lead_that_returns_range_is_known_to_drive_sooner() -> None:
    """20 m/s behind a car at 16 m/s, 45 m ahead."""

    def seen(t_s: float, returns: int) -> VisionMeasurement:
        range_m = 45.0 - 4.0 * t_s
        half = 600.0 / range_m
        box = Detection((400.0 - half, 300.0 - half, 400.0 + half, 300.0 + half), "car", 0.9)
        ranged = {"ranged_m": range_m, "ranged_sigma_m": 0.5, "returns": returns} if returns else {}
        return VisionMeasurement(box, range_m, 0.2 * range_m, (range_m, 0.0), 0.08, 0.15, **ranged)  # type: ignore[arg-type]

    wander = {}
    for returns in (0, 3):
        state = VisionTrackerState()
        for k in range(16):
            state, (only,) = track(state, (seen(0.1 * k, returns),), 0.1 if k else None, VisionTrackingParams(), 20.0)
        wander[returns] = only.wander_mps
    assert wander[3] < 0.3 * wander[0]
    for _ in range(8):
        state, (only,) = track(state, (seen(1.5, 0),), 0.1, VisionTrackingParams(), 20.0)
    assert only.wander_mps > 3.0 * wander[3], "without returns, the boxes count again"
