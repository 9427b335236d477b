"""Measures the memory of a worker: over many drives, and in one session of 36 GB.

    python -m tests.soak.fleet.memory --folder DIR --drives 500
    python -m tests.soak.fleet.memory --folder DIR --gigabytes 36 --frames 10000

DIR holds sessions of ``tests.soak.fleet``. Many drives are links to them. The long session repeats one of them, with
images of ``IMAGE_BYTES``, which are read, and records of no known kind, which take the rest of the size and must not be
read: both are zeros for the most part, which take no room on the disk. One worker runs them with the limit of
``LIMIT``, at which Dask would restart it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
import psutil
from mcap.writer import CompressionType

from app.fleet.batch.schedule import Tally, client_of, run_batch
from pipeline.recording.mcap import output
from pipeline.recording.save import about
from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import open_source
from pipeline.types import CameraImage, Frame
from tests.app.fleet.fleets import begun, plan_of

LIMIT = "1.5GB"
STEP_NS = 100_000_000
IMAGE_BYTES = 400_000
"""Of one JPEG image: a picture and zeros after it, which a decoder ignores."""
UNKNOWN_RECORD = 0x90
"""Opcodes from 0x80 on are free for records of applications; readers skip them."""
HOLE = bytes(1 << 16)
"""A block of the file that is not written if it is zero."""


class SparseFile:
    """A file in which blocks of zeros stay holes."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        for first in range(0, len(view), len(HOLE)):
            block = view[first : first + len(HOLE)]
            if len(block) == len(HOLE) and block == HOLE:
                self._file.seek(len(HOLE), os.SEEK_CUR)
            else:
                self._file.write(block)
        return len(view)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def make_long(file: Path, short: Path, frames: int, size_bytes: float) -> None:
    """A session of so many frames and bytes, uncompressed, from the frames of a short one without labels."""
    source = open_source(str(short))
    parts = [source.frame(index) for index in range(len(source))]
    bgr = np.full((480, 640, 3), 90, np.uint8)
    jpeg = cv2.imencode(".jpg", bgr)[1].tobytes()
    sparse, skipped = bytes(IMAGE_BYTES - len(jpeg)), max(0, round(size_bytes / frames) - IMAGE_BYTES)
    output._COMPRESSION["none"] = CompressionType.NONE  # type: ignore[index]
    writer = SessionWriter(file, about(source), compression="none")  # type: ignore[arg-type]
    stream = writer._output._stream
    stream.file = SparseFile(stream.file)  # type: ignore[assignment]
    try:
        for index, frame in enumerate(islice(cycle(parts), frames)):
            t_ns = parts[0].t_ns + index * STEP_NS
            # a few bytes differ, or the writer would store the image once
            picture = CameraImage(t_ns, bgr, jpeg + index.to_bytes(4, "little") + sparse)
            writer.write(_at(frame, index, t_ns, picture))
            writer.flush()
            stream.file.write(struct.pack("<BQ", UNKNOWN_RECORD, skipped))
            stream.file.seek(skipped, os.SEEK_CUR)
        writer.close()
    except BaseException:
        writer.discard()
        raise


def _at(frame: Frame, index: int, t_ns: int, image: CameraImage) -> Frame:
    sweep = replace(frame.sweep, t_ns=t_ns) if frame.sweep is not None else None
    return replace(frame, index=index, name=f"{index:06d}", t_ns=t_ns, sweep=sweep, image=image)


def measured(addresses: list[Path], out: Path) -> dict[str, Any]:
    """Run these sessions by one worker, and watch its memory."""
    work = begun(plan_of(*addresses), out)
    tally, ends_mb = Tally(len(work.all)), list[float]()
    start = perf_counter()
    with client_of(None, 1, LIMIT) as client, _watched(next(iter(client.run(os.getpid).values()))) as seen_mb:
        before = client.run(os.getpid)
        run_batch(client, work.jobs, tally, lambda _: ends_mb.append(seen_mb[-1]))
        is_same = client.run(os.getpid) == before
    samples = [max(part) for part in np.array_split(np.array(seen_mb), min(10, len(seen_mb)))]
    return {
        "drives": tally.done,
        "frames": tally.frames,
        "aside": tally.aside,
        "failed": tally.failed,
        "same_worker_throughout": is_same,
        "most_mb": round(max(seen_mb)),
        "most_mb_by_tenth_of_the_time": [round(float(each)) for each in samples],
        "mb_after_20_drives_and_last": [round(ends_mb[min(19, len(ends_mb) - 1)]), round(ends_mb[-1])],
        "wall_s": round(perf_counter() - start),
    }


@contextmanager
def _watched(pid: int) -> Iterator[list[float]]:
    """Resident megabytes of a process, five times a second."""
    process, ended = psutil.Process(pid), threading.Event()
    seen = [process.memory_info().rss / 1e6]

    def watch() -> None:
        while not ended.wait(0.2):
            try:
                seen.append(process.memory_info().rss / 1e6)
            except psutil.NoSuchProcess:
                return

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield seen
    finally:
        ended.set()
        thread.join()


def links(folder: Path, sessions: list[Path], count: int) -> list[Path]:
    """So many names for these sessions, each a drive of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for number, session in enumerate(islice(cycle(sessions), count)):
        made.append(folder / f"{number:05d}-{session.name}")
        if not made[-1].exists():
            os.link(session, made[-1])
    return made


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--drives", type=int, default=0)
    parser.add_argument("--gigabytes", type=float, default=0.0)
    parser.add_argument("--frames", type=int, default=10_000)
    asked = parser.parse_args()
    sessions, out = sorted(asked.folder.glob("*.mcap")), asked.folder / "memory-out"
    shutil.rmtree(out, ignore_errors=True)
    if asked.drives:
        print(json.dumps(measured(links(asked.folder / "links", sessions, asked.drives), out)), flush=True)
    if asked.gigabytes:
        file = asked.folder / "long" / "long.mcap"
        file.parent.mkdir(exist_ok=True)
        file.unlink(missing_ok=True)
        make_long(file, sessions[0], asked.frames, 1e9 * asked.gigabytes)
        size = {"GB": round(file.stat().st_size / 1e9, 1), "GB_on_disk": round(file.stat().st_blocks * 512 / 1e9, 2)}
        print(json.dumps(size | measured([file], out)), flush=True)
        file.unlink()


if __name__ == "__main__":
    main()
