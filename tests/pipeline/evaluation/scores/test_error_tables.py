"""How honest the sigmas are: the share of distance errors within 1, 2 and 3 of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.error_tables import errors_section, sigma_rows
from pipeline.evaluation.scores.report import as_json
from pipeline.types import ObjectSource
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import believed, truth


def drive(errors_m: list[float], at_m: float, source: ObjectSource = "VL", sigma_m: float | None = 0.1) -> DriveScore:
    """One vehicle, with one frame per distance error."""
    known = truth(*({1: (at_m, 0.0)} for _ in errors_m))
    results = [
        believed(n, [replace(fused(7, at_m + off, source=source), distance_sigma_m=sigma_m)], 7)
        for n, off in enumerate(errors_m)
    ]
    return score_drive(results, known, Rules())


def test_shares_are_by_sensor_and_by_twenty_metres() -> None:
    near, far = drive([0.05, 0.15, -0.25, 0.35], 18.0), drive([-3.0, 8.0], 50.0, "V", sigma_m=5.0)
    assert sigma_rows([near, far]) == (
        ("all", "VL", 4, 25.0, 50.0, 75.0),
        ("all", "V", 2, 50.0, 100.0, 100.0),
        ("0–20 m", "VL", 4, 25.0, 50.0, 75.0),
        ("40–60 m", "V", 2, 50.0, 100.0, 100.0),
    )
    assert as_json([near])["sigmas"][0] == {
        "vehicles": "all",
        "seen by": "VL",
        "count": 4,
        "within 1 σ": 25.0,
        "within 2 σ": 50.0,
        "within 3 σ": 75.0,
    }


@pytest.mark.parametrize("sigma_m", [None, 0.0])
def test_what_gives_no_sigma_is_not_counted(sigma_m: float | None) -> None:
    assert sigma_rows([drive([0.1], 18.0, sigma_m=sigma_m)]) == ()


def test_the_report_shows_them_beside_the_errors() -> None:
    _, sigmas = errors_section([drive([0.05], 18.0)]).tables
    assert sigmas.rows == sigma_rows([drive([0.05], 18.0)])
