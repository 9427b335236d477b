"""Measures the cost of a batch: fits processor time to measured drives, and predicts that of 10,000 hours.

    python -m tests.soak.fleet.cost FOLDER

FOLDER holds sessions of ``tests.soak.fleet``. Parts of 10, 25 and 50 frames of simulated ones, whose detections are
given, and real ones, whose images a network looks at, run one after another in this process. Processor time counts, so
other programs hardly matter. The model: seconds = begin × drives + frame × frames + image × images looked at.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from time import process_time

import numpy as np

from app.fleet.batch.job import Outcome
from app.fleet.batch.work import run_drive
from pipeline.recording.save import save
from pipeline.sources import open_source
from tests.app.fleet.fleets import job_of

LENGTHS, EACH, REAL = (10, 25, 50), 6, 8
HOURS, RATE_HZ, DRIVE_MIN = 10_000, 10, 10
"""Hours, frame rate and minutes per drive of the predicted fleet."""


def measure(folder: Path) -> list[tuple[int, int, float]]:
    """(frames, images looked at, processor seconds) of each drive."""
    rows = []
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
        for each in (*parts, *real[:: max(1, len(real) // REAL)]):
            start = process_time()
            outcome = run_drive(job_of(str(each), Path(work, "out")))
            seconds = process_time() - start
            assert isinstance(outcome, Outcome)
            assert outcome.frames, outcome.reason
            rows.append((outcome.frames, outcome.looked_at, seconds))
    return rows[1:]  # the first drive compiles and opens the networks


def main(folder: str) -> None:
    rows = np.array(measure(Path(folder)))
    known = np.column_stack([np.ones(len(rows)), rows[:, 0], rows[:, 1]])
    (begin_s, frame_s, image_s), *_ = np.linalg.lstsq(known, rows[:, 2], rcond=None)
    foretold = known @ (begin_s, frame_s, image_s)
    frames, drives = HOURS * 3600 * RATE_HZ, HOURS * 60 / DRIVE_MIN
    hours = {
        "with detections given": (begin_s * drives + frame_s * frames) / 3600,
        "with a network on each image": (begin_s * drives + (frame_s + image_s) * frames) / 3600,
    }
    report = {
        "drives": len(rows),
        "begin_s": round(float(begin_s), 3),
        "frame_ms": round(1e3 * float(frame_s), 2),
        "image_ms": round(1e3 * float(image_s), 1),
        "median_error_percent": round(100 * float(np.median(np.abs(foretold - rows[:, 2]) / rows[:, 2])), 1),
        "core_hours_for_10000_h": {name: round(float(value)) for name, value in hours.items()},
    }
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main(sys.argv[1])
