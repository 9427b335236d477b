"""Measures the cost of a batch: fits processor time to measured drives, and predicts that of 10,000 hours.

    python -m tests.soak.fleet.cost FOLDER

FOLDER holds sessions of ``tests.soak.fleet`` of at least 50 frames, and real ones. Parts of 10, 25 and 50 frames of
simulated ones, whose detections are given, and real ones, whose images networks look at, run one after another in this
process. Processor time counts, so other programs hardly matter. The model: seconds = begin × drives + frame × frames +
image × images of which a network looks at the whole + all × images that all networks of the default look at, lanes and
far view included.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from app.fleet.batch.job import Job, Outcome
from app.fleet.batch.keys import networks_digest
from app.fleet.batch.work import run_drive
from pipeline.detection import DetectorChoice
from pipeline.recording.save import save
from pipeline.sources import open_source
from tests.app.fleet.fleets import CHOICE, job_of

LENGTHS, EACH, REAL = (10, 25, 50), 6, 8
HOURS, RATE_HZ, DRIVE_MIN = 10_000, 10, 10
"""Hours, frame rate and minutes per drive of the predicted fleet."""


def measure(folder: Path) -> list[tuple[int, int, int, float]]:
    """(frames, images with one network, images with all, processor seconds) of each drive."""
    rows: list[tuple[int, int, int, float]] = []
    with tempfile.TemporaryDirectory(prefix="cipv-cost-") as work:
        simulated = sorted(folder.glob("drive-*.mcap"))[: EACH + 1]
        parts = [Path(work, "warm.mcap")]
        save(open_source(str(simulated[0])), parts[0], 0, 9)
        for file in simulated[1:]:
            for frames in LENGTHS:
                part = Path(work, f"{file.stem}-{frames}.mcap")
                save(open_source(str(file)), part, 0, frames - 1)
                parts.append(part)
        real = sorted(folder.glob("real-*.mcap"))
        real = real[:: max(1, len(real) // REAL)]
        kinds = {file.stem.rpartition("-")[0]: file for file in real}.values()
        for n, part in enumerate(parts):
            frames, seconds = _timed(job_of(str(part), Path(work, "one")))
            if n:  # the first drive compiles
                rows.append((frames, 0, 0, seconds))
        for place, choice in ((1, CHOICE), (2, DetectorChoice())):
            for n, file in enumerate([*kinds, *real]):
                job = job_of(str(file), Path(work, f"{place}-{n}"))
                key = replace(job.key, networks=networks_digest(choice))
                frames, seconds = _timed(replace(job, choice=choice, key=key))
                if n >= len(kinds):  # the first drives with images of a size open the networks
                    rows.append((frames, frames * (place == 1), frames * (place == 2), seconds))
    return rows


def _timed(job: Job) -> tuple[int, float]:
    """Frames of a drive, and processor seconds to run it."""
    start = process_time()
    outcome = run_drive(job)
    seconds = process_time() - start
    assert isinstance(outcome, Outcome)
    assert outcome.frames, outcome.reason
    return outcome.frames, seconds


def main(folder: str) -> None:
    rows = np.array(measure(Path(folder)))
    known, took_s = np.column_stack([np.ones(len(rows)), rows[:, :3]]), rows[:, 3]
    fitted, *_ = np.linalg.lstsq(known, took_s, rcond=None)
    begin_s, frame_s, image_s, all_s = fitted
    foretold = known @ fitted
    frames, drives = HOURS * 3600 * RATE_HZ, HOURS * 60 / DRIVE_MIN
    hours = {
        "with detections given": (begin_s * drives + frame_s * frames) / 3600,
        "with a network on each image": (begin_s * drives + (frame_s + image_s) * frames) / 3600,
        "with all networks on each image": (begin_s * drives + (frame_s + all_s) * frames) / 3600,
    }
    report = {
        "drives": len(rows),
        "begin_s": round(float(begin_s), 3),
        "frame_ms": round(1e3 * float(frame_s), 2),
        "image_ms": round(1e3 * float(image_s), 1),
        "all_networks_ms": round(1e3 * float(all_s), 1),
        "median_error_percent": round(100 * float(np.median(np.abs(foretold - took_s) / took_s)), 1),
        "core_hours_for_10000_h": {name: round(float(value)) for name, value in hours.items()},
    }
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main(sys.argv[1])
