"""Curves as arcs: through their points, within the tolerance between them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation.openscenario.roads.arc_fit import TOLERANCE_M, TOLERANCE_RAD, fit_arcs
from pipeline.simulation.world.lines import RoadLine

X = np.linspace(0.0, 300.0, 3001)


def poses(y: np.ndarray, slope: np.ndarray) -> np.ndarray:
    return np.column_stack([X, y, np.arctan(slope)])


WAVE = poses(8.0 * np.sin(X / 40.0), 0.2 * np.cos(X / 40.0))
CUBIC = poses(1e-6 * X**3, 3e-6 * X**2)


@pytest.mark.parametrize("curve", [WAVE, CUBIC], ids=["wave", "cubic"])
def test_arcs_pass_between_the_samples_of_a_curve(curve: np.ndarray) -> None:
    """Fitted to every tenth point, compared at every point."""
    fitted = fit_arcs(curve[::10])
    line = RoadLine(fitted.arcs, tuple(curve[0]))
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve[:, :2], axis=0).T))])
    assert fitted.at_m[-1] == pytest.approx(lengths[-1], abs=0.01)
    there = line.to_world(lengths * fitted.at_m[-1] / lengths[-1], 0.0)
    away = curve[:, :2] - there[:, :2]
    across = away[:, 1] * np.cos(there[:, 2]) - away[:, 0] * np.sin(there[:, 2])
    assert np.abs(across).max() <= 1.2 * TOLERANCE_M
    assert np.abs(curve[:, 2] - there[:, 2]).max() <= 1.5 * TOLERANCE_RAD
    assert len(fitted.arcs) < 80


def test_a_circle_is_one_arc_and_a_line_is_one_line() -> None:
    turned = np.linspace(0.0, 2.0, 50)
    circle = np.column_stack([50 * np.sin(turned), 50 * (1 - np.cos(turned)), turned])
    assert fit_arcs(circle).arcs == [pytest.approx((100.0, 0.02))]
    line = np.column_stack([X[:50], np.zeros(50), np.zeros(50)])
    assert fit_arcs(line).arcs == [pytest.approx((float(X[49]), 0.0))]


def test_the_arcs_meet_the_samples_that_they_name() -> None:
    fitted = fit_arcs(WAVE[::10])
    line = RoadLine(fitted.arcs, tuple(WAVE[0]))
    met = line.to_world(np.array(fitted.at_m), 0.0)
    assert met == pytest.approx(WAVE[::10][fitted.samples], abs=1e-6)
