"""A worker's tasks: run one recording, or the networks on a piece of one. All output goes to the batch's store as
whole files, so a worker may be killed at any time and another one can repeat its work."""

from __future__ import annotations

import json
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import zstandard
from distributed import get_worker
from pydantic import TypeAdapter
from typing_extensions import TypedDict

from app.drive.events import find_events
from app.drive.events.event import event_fields
from app.drive.frame_rows import Objects, Row, objects_of, row_of
from app.fleet.batch.answers import KeptLook
from app.fleet.batch.drive_scores import scores_of
from app.fleet.batch.drive_tables import FrameTables, Gap, gap_of, write_drive, write_events, write_scores
from app.fleet.batch.job import Job, Outcome, TooLong, aside_file
from app.fleet.batch.keys import code_digest, networks_digest
from app.fleet.batch.tables import DRIVES, EVENTS, FRAMES, OBJECTS, SCORES, TIMINGS, file_of
from app.fleet.batch.unused_memory import return_unused
from app.fleet.batch.worker_detectors import detectors_for
from app.fleet.stored_json import read_json
from pipeline.common.errors import BadInput
from pipeline.detection import Detectors, detect
from pipeline.evaluation.label_free.history import History
from pipeline.evaluation.scores.results_file import EMPTY
from pipeline.run import patiently, run, used
from pipeline.sources import open_source
from pipeline.types import Frame, Result
from pipeline.types.result_json import to_line
from pipeline.types.source import Source, SourceError


class _Said(TypedDict, total=False):
    frames: int
    reason: str


_SAID = TypeAdapter(_Said)
MOST_LABELLED = 6000
"""Results of labelled frames are held until the drive's end, some 75 KB each with 16 objects: no drive is scored
against more."""


class WrongWorker(BadInput):
    """A worker with other code or other networks than the batch was started with."""


def run_drive(job: Job, may_split: bool = False) -> Outcome | TooLong:
    """Run one recording, write its tables, and mark it as done. A recording that cannot be read is set aside, with the
    reason.

    Args:
        job: which one.
        may_split: return ``TooLong`` instead if several workers should process the recording's images first.

    Raises:
        WrongWorker: see there. Overloaded: the store keeps failing.
    """
    start = perf_counter()
    _check(job)
    before = _before(job)
    if before is not None:
        return before
    if not _is_text(job.recording.address):
        return set_aside(job, "its name is not valid UTF-8, which tables cannot hold; rename it")
    try:
        source = open_source(job.recording.address, rings=job.key.rings)
        if not len(source):
            raise SourceError(f"{job.recording.address}: the recording holds no frames")
        detectors = detectors_for(source, job)
        if may_split and _missing_pieces(source, detectors, job):
            return TooLong(tuple(range(0, len(source), job.piece_frames)))
        with tempfile.TemporaryDirectory(prefix="cipv-batch-", dir=_scratch()) as folder:
            looked_at = _run(job, source, detectors, Path(folder))
    except WrongWorker:
        raise
    except BadInput as error:
        return set_aside(job, str(error), perf_counter() - start)
    finally:
        return_unused()
    _write(job, job.done_file, {"frames": len(source)})
    return Outcome(job.recording.drive, len(source), looked_at, perf_counter() - start)


def _scratch() -> str | None:
    """A worker's own folder, which Dask clears after one that was killed; None outside of a worker."""
    try:
        return str(get_worker().local_directory)
    except ValueError:
        return None


def look_at_piece(job: Job, first: int) -> int:
    """Run the detectors on the images of one piece of a recording, and save their detections. Returns how many images
    networks processed. Raises BadInput for a recording that cannot be read, and what ``run_drive`` raises."""
    _check(job)
    source = open_source(job.recording.address, rings=job.key.rings)
    detectors = detectors_for(source, job)
    if job.store.has(job.answers(detectors, first)):
        return 0
    kept = KeptLook(job.store, job.recording.mark, detectors, job.piece_frames)
    for index in range(first, min(first + job.piece_frames, len(source))):
        detect(patiently(source, index), used(detectors, job.key.params), kept)
    kept.close()
    return_unused()
    return kept.asked


def set_aside(job: Job, reason: str, seconds: float = 0.0) -> Outcome:
    """Note why a recording could not be run; it is not tried again unless it changes."""
    reason = job.reason(reason)
    _write(job, aside_file(job.key.name, job.recording), {"reason": reason})
    return Outcome(job.recording.drive, 0, 0, seconds, reason)


def _is_text(address: str) -> bool:
    """False for a file name with bytes that are no UTF-8, which Python holds as lone surrogates."""
    try:
        address.encode()
    except UnicodeEncodeError:
        return False
    return True


def _write(job: Job, name: str, what: dict[str, object]) -> None:
    said = {"drive": job.recording.drive, "address": job.recording.address, "mark": job.recording.mark} | what
    job.store.write(name, json.dumps(said, indent=1).encode())


def _before(job: Job) -> Outcome | None:
    """What became of it before; None where nothing has."""
    for name in (job.done_file, aside_file(job.key.name, job.recording)):
        with suppress(BadInput):  # one whose file is damaged is processed again
            said = read_json(job.store, name, _SAID)
            if said is not None:
                return Outcome(job.recording.drive, said.get("frames", 0), 0, 0.0, said.get("reason", ""))
    return None


def _check(job: Job) -> None:
    if code_digest() != job.key.code:
        raise WrongWorker(
            "a worker does not have the same version of CIPV Studio, or of its libraries, as `cipv batch`"
        )
    if networks_digest(job.choice) != job.key.networks:
        raise WrongWorker("a worker does not have the same networks as the machine that runs `cipv batch`")


def _missing_pieces(source: Source, detectors: Detectors, job: Job) -> bool:
    """Whether networks have to look at more than one piece of it."""
    if not detectors.names or len(source) <= job.piece_frames:
        return False
    return not all(job.store.has(job.answers(detectors, first)) for first in range(0, len(source), job.piece_frames))


def _run(job: Job, source: Source, detectors: Detectors, folder: Path) -> int:
    """Write the drive's part of every table. Returns how many images networks looked at."""
    kept = KeptLook(job.store, job.recording.mark, detectors, job.piece_frames)
    run_name, drive = job.key.name, job.recording.drive
    rows: list[Row] = []
    objects: list[Objects] = []
    gaps: list[Gap] = []
    labelled: list[Result] = []
    history, light = History(), float("nan")
    with FrameTables(folder) as tables, _Lines(folder, job.keeps_results) as lines:
        for frame, result in run(source, job.key.params, detectors, job.key.sensors, kept):
            row, records = row_of(frame, result), objects_of(result)
            tables.add(frame, result, row, records)
            lines.add(result)
            history.add(result)
            rows.append(row)
            objects.append(event_fields(records))
            gaps.append(gap_of(row, records))
            if np.isnan(light):
                light = _brightness(frame)
            if len(labelled) < MOST_LABELLED and source.truth(frame.index) is not None:
                labelled.append(replace(result, layers=EMPTY))
    kept.close()
    gap_s = job.key.params.time.reset_gap_s
    write_events(folder / f"{EVENTS.name}.parquet", find_events(rows, objects, job.key.params), rows, gaps, gap_s)
    write_scores(folder / f"{SCORES.name}.parquet", scores_of(history, labelled, source, job.key.params))
    write_drive(folder / f"{DRIVES.name}.parquet", _drive_values(job, source, rows, len(labelled), light))
    shapes = (FRAMES, OBJECTS, TIMINGS, EVENTS, SCORES, DRIVES)
    files = {file_of(shape.name, run_name, drive): folder / f"{shape.name}.parquet" for shape in shapes}
    if job.keeps_results:
        files[f"results/run={run_name}/{drive}.jsonl.zst"] = folder / _Lines.NAME
    job.store.put_all(files)
    return kept.asked


class _Lines:
    """Results as `cipv run --out` writes them, packed, without timings: equal inputs give equal bytes."""

    NAME = "results.jsonl.zst"

    def __init__(self, folder: Path, wanted: bool) -> None:
        self._file = (folder / self.NAME).open("wb") if wanted else None
        self._packer = zstandard.ZstdCompressor().stream_writer(self._file) if self._file is not None else None

    def __enter__(self) -> _Lines:
        return self

    def __exit__(self, *_: object) -> None:
        if self._packer is not None:
            self._packer.close()  # closes the file too

    def add(self, result: Result) -> None:
        if self._packer is not None:
            self._packer.write(to_line(replace(result, timing_ms={})).encode())


def _drive_values(job: Job, source: Source, rows: list[Row], labelled: int, light: float) -> tuple[object, ...]:
    """The drive's row of the table ``drives``."""
    speeds = np.array([row.speed_mps for row in rows if row.speed_mps is not None])
    bends = [
        abs(row.yaw_rate_radps / row.speed_mps)
        for row in rows
        if row.yaw_rate_radps is not None and row.speed_mps is not None and row.speed_mps > 3.0
    ]
    leads = [row.distance_m for row in rows if row.distance_m is not None]
    return (
        job.recording.address,
        source.title,
        job.recording.mark,
        len(rows),
        (rows[-1].t_ns - rows[0].t_ns) / 1e9,
        rows[0].t_ns,
        _mean(speeds),
        _mean(bends),
        _mean(leads),
        len(leads),
        labelled,
        light,
    )


def _mean(values: object) -> float | None:
    found = np.asarray(values, np.float64)
    return float(found.mean()) if found.size else None


def _brightness(frame: Frame) -> float:
    """Mean of the image; NaN without one."""
    return float(frame.image.bgr.mean()) if frame.image is not None else float("nan")
