"""Measures how well scores without labels rank drives and parameters as labels do, for docs/reference/fleet-scores.md.

    python -m tests.soak.fleet.ranks --folder DIR --drives 36

Drives: simulated traffic on straight roads, 20 s each, with sensor faults; and, with ``CIPV_DATA``, the four runs of
Astyx, the further Astyx frames that follow each other, and KITTI's drives 0052 and 0009. They run in this process under
each of ``SETS``. Results that are in the folder already are used again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from app.bench.fleet_sessions import make_sessions
from app.fleet.batch.drive_scores import LABELLED
from app.fleet.batch.work import run_drive
from app.fleet.compare.paired import ScoreRow
from app.fleet.compare.worth import Worth, spearman, values_of, worths
from app.fleet.find import FleetTables
from app.fleet.pack import pack
from app.fleet.store import Store
from pipeline.common.files.data_dir import data_dir
from pipeline.evaluation.label_free.score import SCORES, LabelFreeScore
from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.evaluation.scores.figures import CONFIDENCE, RESAMPLES, SEED
from pipeline.evaluation.scores.truth import of_labels
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.registry import import_labels
from pipeline.labels.model import Origin
from pipeline.params import Params, preset, with_changes
from pipeline.recording.save import about, save
from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import open_source
from tests.app.fleet.fleets import begun, plan_of
from tests.conftest import ROOT

SECONDS = 20.0
PARTS = {
    "astyx-047": ("astyx", 0, 4),
    "astyx-057": ("astyx", 5, 16),
    "astyx-183": ("astyx", 17, 26),
    "astyx-414": ("astyx", 27, 38),
    "astyx-more-013": ("astyx_more", 13, 21),
    "kitti-0052": ("kitti_0052", 0, 22),
}
"""Name → folder, first and last frame of moments that follow each other."""
STREET = "kitti_0009"


def sets() -> dict[str, tuple[Params, str]]:
    """Name → parameters and sensors. They change what the scores judge: distances, the corridor, and the choice of
    the lead."""
    default = Params()
    raised = {
        "lidar_tracking.position_sigma_m": 0.6,
        "lidar_tracking.accel_sigma_mps2": 10.0,
        "vision_tracking.bearing_sigma_deg": 1.0,
        "vision_tracking.accel_sigma_mps2": 12.0,
        "distance.height_sigma_px": 6.0,
    }
    hasty = {"cipv.confirm_hits": 1, "cipv.hysteresis_m": 0.0, "cipv.decide_s": 0.0, "existence.enabled": False}
    plain = {"vision_tracking.learn_height": False, "vision_tracking.use_aspect": False}
    held = {
        "lidar_tracking.max_missed_s": 3.0,
        "vision_tracking.max_missed_s": 4.0,
        "cipv.carried_may_become_lead": True,
    }
    return {
        "default": (default, "both"),
        "noise raised": (with_changes(default, raised), "both"),
        "corridor of half width 2.6 m": (with_changes(default, {"path.half_width_m": 2.6}), "both"),
        "no confirmation, no hysteresis, no existence": (with_changes(default, hasty), "both"),
        "heights of classes": (with_changes(default, plain), "both"),
        "paper": (preset("paper"), "both"),
        "camera alone": (default, "camera"),
        "LiDAR alone": (default, "lidar"),
        "corridor of half width 1.1 m": (with_changes(default, {"path.half_width_m": 1.1}), "both"),
        "no existence": (with_changes(default, {"existence.enabled": False}), "both"),
        "8 sightings": (with_changes(default, {"cipv.confirm_hits": 8}), "both"),
        "leads at 0.95": (with_changes(default, dict.fromkeys(_BECOME, 0.95)), "both"),
        "leads at once": (with_changes(default, dict.fromkeys((*_BECOME, *_STAY), 0.0)), "both"),
        "clusters of 20 points": (with_changes(default, {"cluster.min_points": 20}), "both"),
        "clusters 1.8 m apart": (with_changes(default, {"cluster.tolerance_m": 1.8}), "both"),
        "objects held for seconds": (with_changes(default, held), "both"),
    }


_BECOME = tuple(f"cipv.become_{name}" for name in ("existence", "probability", "camera", "standing", "oncoming"))
_STAY = ("cipv.stay_probability", "cipv.stay_standing")


DISAGREEMENT = LabelFreeScore(
    "disagreement", "disagreement of camera and LiDAR", "σ", "lower", SCORES[0].of, "lead_distance"
)
"""A candidate that is computed from the tables here: the mean of the lead's ``vl_gap_sigmas``."""


def make_fleet(folder: Path, count: int) -> list[Path]:
    """So many simulated sessions, and the real ones."""
    folder.mkdir(parents=True, exist_ok=True)
    return [*make_sessions(folder, count, SECONDS), *_real(folder)]


def _real(folder: Path) -> Iterator[Path]:
    for name, (inside, first, last) in PARTS.items():
        file = folder / f"{name}.mcap"
        if not file.exists():
            if not (data_dir() / inside).is_dir():
                continue
            scheme = inside.partition("_")[0]
            save(open_source(f"{scheme}:{data_dir() / inside}"), file, first, last)
        yield file
    street = folder / "kitti-0009.mcap"
    if not street.exists():
        if not (data_dir() / STREET).is_dir():
            return
        _save_street(data_dir() / STREET, street)
    yield street


def _save_street(folder: Path, out: Path) -> None:
    """KITTI's drive 0009 with the labels of the tracking benchmark as its own."""
    source = open_source(f"kitti:{folder}/2011_09_26/2011_09_26_drive_0009_sync")
    labels = import_labels(
        folder / "label_02.txt", drive_of(source), "kitti-tracking", Origin("import", "test", 0)
    ).labels
    truth = of_labels(labels, LeadRule()).frames
    writer = SessionWriter(out, about(source))
    try:
        for index in range(len(source)):
            known = truth.get(source.t_ns(index))
            writer.write(source.frame(index), truth=known.objects if known is not None else ())
        writer.close()
    except BaseException:
        writer.discard()
        raise


def run_set(files: list[Path], out: Path, params: Params, sensors: str) -> list[ScoreRow]:
    """Every score of every drive under one set of parameters. Networks look at an image once for all sets."""
    store = Store(str(out))
    work = begun(plan_of(*files, params=params, sensors=sensors), out)
    for job in work.jobs:
        outcome = run_drive(job)
        if outcome.reason:  # type: ignore[union-attr]
            raise RuntimeError(f"{job.recording.address}: {outcome.reason}")  # type: ignore[union-attr]
    pack(store, work.key.name)
    tables = FleetTables(store, work.key.name)
    return [*tables.scores(), *_disagreement(tables)]


def _disagreement(tables: FleetTables) -> Iterator[ScoreRow]:
    sums: dict[str, list[float]] = {}
    for row in tables.rows("frames"):
        if row["vl_gap_sigmas"] is not None:
            sums.setdefault(row["drive"], []).append(row["vl_gap_sigmas"])
    for drive, values in sorted(sums.items()):
        yield drive, DISAGREEMENT.name, sum(values), float(len(values))


JUDGED = ("lead_missed", "cipv_false", "lead_not_correct", "lead_distance")
"""Figures against labels by which sets of parameters are chosen."""


def over_sets(runs: Mapping[str, list[ScoreRow]], label_free: str, labelled: str) -> dict[str, Any] | None:
    """Spearman's correlation of two scores of the whole fleet over the sets, and its 95 % interval, drives drawn with
    replacement. None without both."""
    sums = {name: {(drive, score): pair for drive, score, *pair in rows} for name, rows in runs.items()}
    drives = sorted(
        {drive for drive, score, _, under in next(iter(runs.values())) if score == labelled and under > 0.0}
    )
    if not drives:
        return None
    nothing = [0.0, 0.0]
    known = np.array(
        [
            [[sums[name].get((drive, score), nothing) for drive in drives] for score in (label_free, labelled)]
            for name in runs
        ]
    )  # (sets, 2 scores, drives, over and under)

    def correlation(chosen: npt.NDArray[np.int64]) -> float | None:
        over, under = np.moveaxis(known[:, :, chosen].sum(axis=2), -1, 0)
        both = (under > 0.0).all(axis=1)
        return spearman(over[both] / under[both]) if both.sum() > 3 else None

    random = np.random.default_rng(SEED)
    drawn = [correlation(random.integers(len(drives), size=len(drives))) for _ in range(RESAMPLES)]
    values = [each for each in drawn if each is not None]
    low, high = np.quantile(values, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]) if values else (None, None)
    return {"value": _two(correlation(np.arange(len(drives)))), "interval": [_two(low), _two(high)]}


def _said(each: Worth) -> dict[str, Any]:
    low, high = (each.interval.low, each.interval.high) if each.interval is not None else (None, None)
    return {
        "counterpart": each.score.counterpart,
        "drives": each.drives,
        "pairs": each.pairs,
        "rank_correlation": _two(each.rank_correlation),
        "interval": [_two(low), _two(high)],
        "over_sets": _two(each.over_runs),
        "holds": each.holds,
    }


def _two(value: float | None) -> float | None:
    return None if value is None else round(float(value), 2)


def measured(runs: Mapping[str, list[ScoreRow]]) -> dict[str, Any]:
    """The table over all drives and over real ones alone, and the values of each set over the whole fleet."""
    scores = (*SCORES, DISAGREEMENT)
    real = {name: [row for row in rows if not row[0].startswith("drive-")] for name, rows in runs.items()}
    kept = {each.name for each in scores} | {LABELLED + each.counterpart for each in scores}
    values = {name: {k: _two(v) for k, v in values_of(rows).items() if k in kept} for name, rows in runs.items()}
    return {
        "all": {each.score.name: _said(each) for each in worths(runs, scores)},
        "real": {each.score.name: _said(each) for each in worths(real, scores)},
        "values": values,
    }


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--drives", type=int, default=36, help="simulated drives")
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--report", type=Path, default=ROOT / "build" / "fleet_ranks.json")
    asked = parser.parse_args()
    files = make_fleet(asked.folder / "sessions", asked.drives)
    runs: dict[str, list[ScoreRow]] = {}
    asked.report.parent.mkdir(parents=True, exist_ok=True)
    for name, (params, sensors) in sets().items():
        runs[name] = run_set(files, asked.folder / "out", params, sensors)
        report = {"drives": len(files), "sets": len(runs)} | measured(runs)
        asked.report.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        print(name, "done", flush=True)
    both = {name: rows for name, rows in runs.items() if sets()[name][1] == "both"}  # sweeps do not leave out sensors
    report["over_sets"] = {
        score.name: {name: over_sets(both, score.name, LABELLED + name) for name in {*JUDGED, score.counterpart}}
        for score in (*SCORES, DISAGREEMENT)
    }
    asked.report.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
