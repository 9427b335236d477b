"""Sources become one path by what they are worth, outliers are left out, and nothing jumps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.path import blend_estimates
from pipeline.path.blend_estimates import FusedPath
from pipeline.path.estimates import PathEstimate, PathSourceName, arc, samples

S = samples(100.0)


def estimate(source: PathSourceName, aside_m: float = 0.0, sigma: float = 0.2, curvature: float = 0.0) -> PathEstimate:
    center, _ = arc(curvature, S)
    return PathEstimate(source, center + np.array([0.0, aside_m]), np.full(len(S), sigma))


def fused(*estimates: PathEstimate, expected: FusedPath | None = None) -> tuple[FusedPath, tuple[str, ...]]:
    return blend_estimates.fuse(list(estimates), expected, 1.5, 3.0)


def test_the_mean_is_weighted_by_the_inverse_variances() -> None:
    path, notes = fused(estimate("gnss", 0.0, 0.1), estimate("lane", 0.5, 0.2))
    assert not notes
    assert path.center[30] == pytest.approx([30.0, 0.1])
    assert path.shares[30] == pytest.approx([0.2, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0])  # in the order of SOURCES


def test_two_that_agree_are_surer_than_either() -> None:
    path, _ = fused(estimate("gnss", 0.0, 0.2), estimate("lane", 0.05, 0.2))
    assert path.sigma_m[30] == pytest.approx(0.2 / np.sqrt(2.0), rel=0.05)


def test_two_that_scatter_more_than_they_say_are_less_sure() -> None:
    agreeing, _ = fused(estimate("gnss", 0.0), estimate("lane", 0.1))
    scattered, _ = fused(estimate("gnss", 0.0), estimate("lane", 0.7))
    assert scattered.sigma_m[30] > 2.0 * agreeing.sigma_m[30]


def test_each_carries_where_it_is_sure() -> None:
    lane = PathEstimate("lane", estimate("lane").center, 0.05 + 0.001 * S**2)
    path, _ = fused(lane, estimate("gnss", 0.0, 0.5))
    assert path.shares[10, 0] > 0.8 > 0.2 > path.shares[60, 0]


def test_the_one_that_contradicts_the_rest_is_left_out_and_lowers_confidence() -> None:
    agree = [estimate("lane", 0.0), estimate("yaw_rate", 0.1)]
    path, notes = fused(*agree, estimate("gnss", 5.0))
    assert len(notes) == 1
    assert notes[0].startswith("gnss disagrees with the rest by ")
    assert path.center[30] == pytest.approx([30.0, 0.05], abs=1e-6)
    assert path.shares[30, 1] == 0.0
    assert path.sigma_m[30] > 1.2 * fused(*agree)[0].sigma_m[30]


def test_of_two_that_contradict_each_other_the_expected_path_tells_which() -> None:
    expected, _ = fused(estimate("lane", 0.0))
    path, notes = fused(estimate("lane", 0.1), estimate("gnss", 5.0), expected=expected)
    assert path.center[30, 1] == pytest.approx(0.1)
    assert len(notes) == 1
    path, notes = fused(estimate("lane", 5.0), estimate("gnss", 0.1), expected=expected)
    assert path.center[30, 1] == pytest.approx(0.1)
    assert notes[0].startswith("lane disagrees")


def test_the_only_source_is_never_left_out() -> None:
    expected, _ = fused(estimate("lane", 0.0))
    path, notes = fused(estimate("lane", 3.5), expected=expected)
    assert not notes
    assert path.center[30, 1] == pytest.approx(3.5)


@given(
    st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(0.05, 3.0)), min_size=1, max_size=3), st.floats(-0.008, 0.008)
)
def test_the_mean_lies_between_its_sources(things: list[tuple[float, float]], curvature: float) -> None:
    names: tuple[PathSourceName, ...] = ("lane", "gnss", "yaw_rate")
    estimates = [estimate(name, aside, sigma, curvature) for name, (aside, sigma) in zip(names, things, strict=False)]
    path, _ = fused(*estimates)
    sides = [aside for aside, _ in things]
    off = (path.center - arc(curvature, S)[0])[:, 1]
    assert off.min() >= min(sides) - 0.05
    assert off.max() <= max(sides) + 0.05
    assert np.allclose(path.shares.sum(axis=1), 1.0)
    assert np.all(path.sigma_m > 0.0)


def test_a_path_moves_with_the_car() -> None:
    """The driven arc looks the same from every position on it."""
    radius = 125.0
    path, _ = fused(estimate("yaw_rate", 0.0, 0.2, 1.0 / radius))
    moved = blend_estimates.moved(path, 2.0, 2.0 / radius, 0.1)
    assert np.abs(moved.center - path.center)[:90].max() < 0.02
    assert np.all(moved.sigma_m > path.sigma_m)


def test_a_moved_path_keeps_its_spacing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blend_estimates, "STEP_M", 0.5)
    center, _ = arc(0.0, S / 2)
    rows = np.full(len(S), 0.2)
    path = FusedPath(center, rows, rows, rows, np.ones((len(S), 4)), np.zeros(len(S)))
    assert blend_estimates.moved(path, 2.0, 0.0, 0.1).center == pytest.approx(center)


def test_beyond_its_end_a_moved_path_is_less_sure() -> None:
    path, _ = fused(estimate("gnss", 0.0, 0.2))
    moved = blend_estimates.moved(path, 10.0, 0.0, 0.1)
    assert moved.center[-1] == pytest.approx([100.0, 0.0])
    assert moved.sigma_m[-1] > moved.sigma_m[80] + 0.5


def test_blending_never_jumps_and_gets_there() -> None:
    path, _ = fused(estimate("lane", 0.0, 0.2))
    fresh, _ = fused(estimate("lane", 3.5, 0.2))
    steps = []
    for _ in range(40):
        before = path.center[30, 1]
        blended = blend_estimates.blend(fresh, path, 0.6, 0.3)
        steps.append(np.abs(blended.center - path.center).max())
        path = blended
        assert path.behind_m[30] == pytest.approx(max(abs(3.5 - before) * 0.4 - 0.3, 0.0), abs=1e-6), "and it says so"
    assert max(steps) <= 0.3 + 1e-6
    assert path.center[30, 1] == pytest.approx(3.5, abs=0.05)


def test_what_is_known_outlasts_a_source_that_knows_nothing() -> None:
    known, _ = fused(estimate("gnss", 2.0, 0.1))
    guess, _ = fused(estimate("straight", 0.0, 8.0))
    path = blend_estimates.blend(guess, known, 0.6, 0.3)
    assert path.center[30, 1] == pytest.approx(2.0, abs=0.05)
    assert path.shares[30, 1] > 0.95, "and it is still the route that carries it"


def test_covariance_intersection_is_never_surer_than_its_parts() -> None:
    a, _ = fused(estimate("gnss", 0.0, 0.2))
    path = a
    for _ in range(50):
        path = blend_estimates.blend(a, path, 0.6, 0.3)
    assert path.sigma_m[30] == pytest.approx(0.2)
