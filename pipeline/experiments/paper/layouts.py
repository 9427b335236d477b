"""The paper's three layouts: the target straight ahead, one lane to the left, two lanes to the left.

The ego vehicle drives up to it from 75 m at 54 km/h; the target drives 18 km/h. Sizes and colours differ from run to
run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.evaluation.report_sections import Scene
from pipeline.experiments.straight_track import TARGET
from pipeline.simulation.scenario import Scenario

LAYOUTS = {"a": "straight ahead", "b": "one lane left", "c": "two lanes left"}
_EGO_LANE = -3
_SPEED_MPS, _TARGET_MPS = 15.0, 5.0
_FROM_M, _TO_M = 75.0, 5.0
_SHOWN_AT_S = 5.0
COLOURS = ("#a3202a", "#e8e8e6", "#15181c", "#5b6f86", "#c9a227")


@dataclass(frozen=True)
class LayoutCase:
    """One drive in one of the paper's layouts."""

    layout: str
    """a, b or c."""
    seed: int
    """Seed of noise and scenery."""


def cases(short: bool) -> list[LayoutCase]:
    return [LayoutCase(layout, seed) for layout in LAYOUTS for seed in range(2 if short else 20)]


def scenes() -> tuple[Scene, ...]:
    return tuple(
        Scene(title.capitalize(), scenario(LayoutCase(layout, 0)), _SHOWN_AT_S) for layout, title in LAYOUTS.items()
    )


def scenario(case: LayoutCase) -> Scenario:
    """The scenario of one drive. Cars are 1.48 ± 0.04 m tall, as within one class of cars."""
    rng = np.random.default_rng([case.seed, list(LAYOUTS).index(case.layout)])
    size = (float(rng.normal(4.5, 0.15)), float(rng.normal(1.82, 0.03)), float(rng.normal(1.48, 0.04)))
    target = {
        "id": TARGET,
        "kind": "car",
        "size_m": size,
        "colour": COLOURS[int(rng.integers(len(COLOURS)))],
        "lane": _EGO_LANE + list(LAYOUTS).index(case.layout),
        "offset_m": float(rng.normal(0.0, 0.15)),
        "ahead_m": _FROM_M,
        "speed_mps": {0.0: _TARGET_MPS},
    }
    return Scenario.model_validate(
        {
            "title": f"layout {case.layout}",
            "seed": case.seed,
            "duration_s": (_FROM_M - _TO_M) / (_SPEED_MPS - _TARGET_MPS),
            "road": {"segments": [{"length_m": 5000.0}], "lanes_oncoming": 0},
            "ego": {"lane": _EGO_LANE, "speed_mps": {0.0: _SPEED_MPS}},
            "actors": [target],
        }
    )
