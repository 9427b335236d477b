"""Colours are the protocol's, and impact speeds are held against the Regulation's."""

from __future__ import annotations

import pytest

from pipeline.experiments.euro_ncap.limits import impact_tone, r152_limit_kmh


@pytest.mark.parametrize(
    ("speed_kmh", "impact_kmh", "colour"),
    [
        (20.0, 0.0, "green"),
        (20.0, 0.1, "red"),
        (30.0, 9.9, "brown"),
        (35.0, 10.0, "red"),
        (40.0, 9.9, "orange"),
        (40.0, 19.9, "brown"),
        (45.0, 20.0, "red"),
        (50.0, 9.9, "yellow"),
        (80.0, 10.0, "orange"),
        (80.0, 29.9, "brown"),
        (80.0, 30.0, "red"),
    ],
)
def test_colours(speed_kmh: float, impact_kmh: float, colour: str) -> None:
    assert impact_tone(speed_kmh, impact_kmh) == colour


@pytest.mark.parametrize(("relative", "limit"), [(10, 0), (42, 0), (45, 15), (50, 25), (60, 35), (65, None)])
def test_limits_of_the_regulation(relative: float, limit: float | None) -> None:
    assert r152_limit_kmh(relative) == limit
