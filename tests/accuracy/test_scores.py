"""Scores of real drives against their own labels, with minimums that a change must not fall below."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("trackeval", reason="the extra `scores` is not installed")

from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.error_tables import sigma_rows
from pipeline.evaluation.scores.figures import measure
from pipeline.evaluation.scores.truth import of_source
from pipeline.sources import open_source
from tests.accuracy.drives import FOLDERS, RULE, drive

AT_LEAST = {
    "astyx": {"cipv_correct": 97.0, "recall": 54.0, "precision": 56.0, "mota": 10.0, "idf1": 46.0, "hota": 49.0},
    "kitti": {"cipv_correct": 100.0, "recall": 70.0, "idf1": 50.0, "hota": 54.0},
}
_WELL_KNOWN = 20
"""Number of errors in a table cell from which a share is meaningful."""
AT_MOST = {
    "astyx": {"lead_missed": 0.0, "lead_distance": 0.1, "switches": 0.0, "drop_outs": 0.0, "distance": 1.3},
    "kitti": {"lead_distance": 0.1, "switches": 0.0, "distance": 0.5, "lateral": 0.5},
}


def score_of(data_dir: Path, kind: str) -> DriveScore:
    truth = of_source(open_source(f"{kind}:{data_dir / FOLDERS[kind]}"), RULE)
    return score_drive(drive(data_dir, kind).results.values(), truth, Rules())


@pytest.mark.parametrize("kind", ["astyx", "kitti"])
def test_floors(data_dir: Path, kind: str) -> None:
    values = {each.figure.name: each.value for each in measure([score_of(data_dir, kind)])}
    print({name: round(value, 2) for name, value in values.items() if value is not None})
    for name, least in AT_LEAST[kind].items():
        assert (values[name] or 0.0) >= least, name
    for name, most in AT_MOST[kind].items():
        value = values[name]
        assert value is not None, name
        assert value <= most, name


def test_sigmas_are_honest(data_dir: Path) -> None:
    """90 % of the errors are within two sigmas, for each sensor and each 20 m bin with enough errors."""
    rows = sigma_rows([score_of(data_dir, "astyx"), score_of(data_dir, "kitti")])
    well_known = [row for row in rows if row[0] != "all" and row[2] >= _WELL_KNOWN]
    print(*rows, sep="\n")
    assert len(well_known) >= 2
    assert all(row[4] >= 90.0 for row in well_known), well_known


def test_two_drives_have_intervals_that_hold_their_figures(data_dir: Path) -> None:
    for each in measure([score_of(data_dir, "astyx"), score_of(data_dir, "kitti")]):
        if each.interval is not None:
            assert each.value is not None
            assert each.interval.low <= each.value <= each.interval.high, each.figure.name
