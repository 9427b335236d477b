"""How well scores without labels rank drives and runs as labels do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from app.cli import main
from app.fleet.batch.drive_scores import LABELLED
from app.fleet.batch.work import run_drive
from app.fleet.compare.worth import FEWEST, spearman, worths
from app.fleet.pack import pack
from app.fleet.store import Store
from pipeline.evaluation.label_free.score import SCORES
from pipeline.evaluation.scores.figures import FIGURES
from tests.app.fleet.fleets import SESSIONS, begun, plan_of

LATE = next(score for score in SCORES if score.name == "late_leads")


def rows(free: list[float], labelled: list[float]) -> list[tuple[str, str, float, float]]:
    """Two scores per drive, each over ten frames."""
    pairs = [(LATE.name, free), (LABELLED + LATE.counterpart, labelled)]
    return [(f"d{n:02d}", name, 10.0 * value, 10.0) for name, values in pairs for n, value in enumerate(values)]


def test_the_rank_correlation_is_spearmans():
    random = np.random.default_rng(3)
    pairs = random.normal(size=(40, 2)) + random.normal(size=(40, 1))
    pairs[:6, 0] = 0.0  # ties
    assert spearman(pairs) == pytest.approx(spearmanr(pairs[:, 0], pairs[:, 1]).statistic)
    assert spearman(np.array([[1.0, 2.0], [1.0, 3.0]])) is None


def test_a_score_that_follows_the_labels_holds_and_one_that_does_not_does_not():
    random = np.random.default_rng(0)
    truth = random.uniform(0.0, 10.0, 30)
    follows = worths({"a": rows(list(truth**2), list(truth))}, [LATE])[0]
    assert (follows.rank_correlation, follows.drives, follows.pairs) == (pytest.approx(1.0), 30, 30)
    assert follows.holds
    noise = worths({"a": rows(list(random.uniform(size=30)), list(truth))}, [LATE])[0]
    assert not noise.holds
    against = worths({"a": rows(list(-truth), list(truth))}, [LATE])[0]
    assert against.rank_correlation == pytest.approx(-1.0)
    assert not against.holds


def test_few_drives_tell_nothing():
    few = worths({"a": rows([1.0] * (FEWEST - 1), [1.0] * (FEWEST - 1))}, [LATE])[0]
    assert (few.rank_correlation, few.interval, few.over_runs) == (None, None, None)


def test_runs_are_ranked_by_the_whole_fleet():
    """Within each run, the score ranks drives in the wrong order; between runs, it agrees with the labels."""
    runs = {f"r{n}": rows([10.0 * n, 10.0 * n + 1.0], [10.0 * n + 1.0, 10.0 * n]) for n in range(5)}
    (worth,) = worths(runs, [LATE])
    assert worth.over_runs == pytest.approx(1.0)


def test_every_counterpart_is_a_figure_against_labels():
    computed = {figure.name for figure in FIGURES} | {"camera_distance", "camera_speed", "lead_not_correct"}
    assert {score.counterpart for score in SCORES} <= computed


def test_cipv_scores_prints_both(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    work = begun(plan_of(fleet, sensors="lidar"), tmp_path)
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(tmp_path)), work.key.name)
    with pytest.raises(SystemExit) as end:
        main(["scores", "--out", str(tmp_path), "--json"])
    assert end.value.code == 0
    said = json.loads(capsys.readouterr().out)
    assert said["runs"][work.key.name]["labelled.cipv_correct"] is not None
    assert said["about"][work.key.name] == "lidar only"
    assert said["worth"]["late_leads"]["drives"] == SESSIONS
    with pytest.raises(SystemExit) as end:
        main(["scores", "--out", str(tmp_path)])
    assert "leads found late" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        main(["scores", "--out", str(tmp_path / "nowhere")])
    assert end.value.code == 2
