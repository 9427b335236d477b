"""Checks with the labels of a simulated fleet whether the pipeline is wrong more often in the seconds that `cipv mine`
chooses.

    cipv batch FOLDER --out DIR --results --lanes off --far-view-px 0
    python -m tests.soak.fleet.mining DIR

Prints, for each reason, how many seconds have it, and in what share of them the lead is missed, false or wrong in at
least one frame; and the same of all seconds, and of those that would be chosen.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import zstandard

from app.fleet.find import FleetTables
from app.fleet.mining.choose import LEAST, choose
from app.fleet.mining.seconds import seconds_of
from app.fleet.runs import latest_run
from app.fleet.store import Store
from pipeline.evaluation.scores.drive import Rules, score_drive
from pipeline.evaluation.scores.results_file import read_results
from pipeline.evaluation.scores.truth import of_source
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types.source import Source

RESAMPLED, SEED = 2000, 1


def wrong_frames(store: Store, run: str, drive: str, source: Source) -> set[int]:
    """Frames whose lead differs from the labels."""
    packed = store.read(f"results/run={run}/{drive}.jsonl.zst")
    assert packed is not None
    lines = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    with tempfile.NamedTemporaryFile(suffix=".jsonl") as file:
        file.write(lines)
        file.flush()
        results = read_results(Path(file.name))
    rules = Rules(aeb=Params().aeb)
    judged = score_drive(results, of_source(source, rules.lead), rules)
    return {each.index for each in judged.frames if each.judged and each.judged.verdict not in ("correct", "none")}


def main(out: str) -> None:
    store = Store(out)
    run = latest_run(store)
    tables = FleetTables(store, run)
    seconds = seconds_of(tables)
    addresses = {row["address"]: row["drive"] for row in tables.rows("drives")}
    wrong = np.zeros(len(seconds.second), bool)
    for place, address in enumerate(seconds.addresses):
        frames = wrong_frames(store, run, addresses[address], open_source(address))
        for at in np.flatnonzero(seconds.drive == place):
            wrong[at] = any(n in frames for n in range(seconds.first[at], seconds.last[at] + 1))
    place_of = {
        (seconds.addresses[d], s): n for n, (d, s) in enumerate(zip(seconds.drive, seconds.second, strict=True))
    }
    report = {"all": _said(wrong, seconds.drive, np.ones(len(wrong), bool))}
    for reason, least in LEAST.items():
        report[reason] = _said(wrong, seconds.drive, seconds.values[reason] >= least)
    for count in (50, 100):
        chosen = np.zeros(len(wrong), bool)
        chosen[[place_of[each.address, each.second] for each in choose(seconds, count, 5)]] = True
        report[f"chosen {count}"] = _said(wrong, seconds.drive, chosen)
    print(json.dumps({"drives": len(seconds.addresses), "seconds": len(wrong)} | report, indent=1))


def _said(wrong: np.ndarray, drive: np.ndarray, among: np.ndarray) -> dict[str, float | int | list[float]]:
    """Counts, the share of wrong seconds, and its 95 % interval by resampling drives."""
    drives = np.unique(drive)
    hits = np.array([np.count_nonzero(wrong & among & (drive == each)) for each in drives])
    totals = np.array([np.count_nonzero(among & (drive == each)) for each in drives])
    picked = np.random.default_rng(SEED).integers(0, len(drives), (RESAMPLED, len(drives)))
    sums = totals[picked].sum(axis=1)
    shares = 100 * hits[picked].sum(axis=1)[sums > 0] / sums[sums > 0]
    low, high = np.percentile(shares, (2.5, 97.5)) if len(shares) else (np.nan, np.nan)
    total = int(totals.sum())
    share = round(100 * int(hits.sum()) / total, 1) if total else 0.0
    return {"seconds": total, "wrong_percent": share, "interval": [round(float(low), 1), round(float(high), 1)]}


if __name__ == "__main__":
    main(sys.argv[1])
