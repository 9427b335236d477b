"""Keeps detections on disk by the content of the image, so that no network processes the same image twice, even after a
restart: opening a drive a second time takes as long as reading it."""

from __future__ import annotations

import hashlib
import logging
import queue
import sqlite3
import threading
import zlib
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

import pipeline
from pipeline.types import DistanceLaw, Frame, RawBoxes, RawLanes

logger = logging.getLogger("cipv.detections")

_MOST_BYTES = 500_000_000
"""Of all detections together: some 40,000 images with two networks. The oldest are dropped beyond that."""
_DROPPED_SHARE = 0.2
_LOOK_EVERY = 500
"""The size is checked after this many new detections."""
_BUSY_S = 0.2
"""Another server may be writing; a network is not much slower than a longer wait."""
_ANSWER_S = 0.5
"""A network takes about 0.1 to 0.5 s: it is not worth waiting longer for its earlier answer."""
_MOST_WAITING = 256
"""Detections, of some 5 kB each, that may wait for the disk."""
_CLOSING_S = 1.0
_LEVEL = 1
_CODE = ("vision", "lanes", "inference")
"""Packages whose code decides what a network's detections are."""


class DetectionRow(msgspec.Struct, array_like=True):
    """One detector's output for one image. Arrays are bytes, little-endian."""

    index: int
    """Of the frame in the recording."""
    detector: str
    """Name under which the detector was asked."""
    model: str
    """Name of its network."""
    scores: bytes
    """float32, of each box or lane point."""
    boxes: bytes | None = None
    """float32, four pixels each; None for lanes."""
    labels: list[str] = []
    """Class name of each box."""
    law: DistanceLaw | None = None
    """The detector's distance law."""
    far: tuple[int, int, int, int] | None = None
    """Window of the second look, or the only one in which lane lines were looked for, pixels; None without one."""
    far_count: int = 0
    """How many of the last boxes come from it."""
    points: bytes = b""
    """float32, two pixels each: points of lane lines."""
    line: bytes = b""
    """int32: the number of the line of each point."""


def row_of(index: int, name: str, answer: RawBoxes | RawLanes) -> DetectionRow:
    """The row of a frame's detections by the detector with this name."""
    if isinstance(answer, RawLanes):
        points, line = answer.points.astype("<f4").tobytes(), answer.line.astype("<i4").tobytes()
        scores = answer.scores.astype("<f4").tobytes()
        return DetectionRow(index, name, answer.model, scores, far=answer.window, points=points, line=line)
    return DetectionRow(
        index,
        name,
        answer.model,
        answer.scores.astype("<f4").tobytes(),
        answer.boxes.astype("<f4").tobytes(),
        list(answer.labels),
        answer.law,
        answer.far,
        answer.far_count,
    )


def answer_of(row: DetectionRow) -> RawBoxes | RawLanes:
    """The detections of a row. ValueError for a damaged one."""
    scores = np.frombuffer(row.scores, "<f4").astype(np.float32)
    if row.boxes is None:
        points = np.frombuffer(row.points, "<f4").astype(np.float32).reshape(-1, 2)
        line = np.frombuffer(row.line, "<i4").astype(np.int32)
        return RawLanes(row.model, points, scores, line, window=row.far)
    boxes = np.frombuffer(row.boxes, "<f4").astype(np.float32).reshape(-1, 4)
    if row.law is None or not len(boxes) == len(scores) == len(row.labels):
        raise ValueError("boxes without their law, scores or classes")
    return RawBoxes(row.model, boxes, scores, tuple(row.labels), row.law, row.far, row.far_count)


def seen_mark(frame: Frame) -> bytes | None:
    """Sixteen bytes that identify what detectors are given of a frame: the image (its file as the camera sent it, else
    its pixels), and the calibration and own motion from which the far view follows. None without an image."""
    if frame.image is None:
        return None
    image, camera, ego = frame.image, frame.camera, frame.ego
    digest = hashlib.blake2b(repr(image.bgr.shape).encode(), digest_size=16)
    digest.update(image.encoded if image.encoded is not None else np.ascontiguousarray(image.bgr).data)
    if camera is not None:
        for numbers in (camera.K, camera.distortion, camera.T_camera_ego):
            digest.update(np.ascontiguousarray(numbers, np.float64).data)
    if ego is not None:
        digest.update(repr((ego.speed_mps, ego.yaw_rate_radps)).encode())
    return digest.digest()


class KeptDetections:
    """Detections in a file, by image and detector. Any thread; several processes may use the same file. A disk that
    cannot be read or written only costs time: networks run again. One that hangs holds nobody up: a thread of its own
    uses the file, and an answer is waited for only briefly."""

    def __init__(self, file: Path, most_bytes: int = _MOST_BYTES) -> None:
        self._file, self._most_bytes = file, most_bytes
        self._database: sqlite3.Connection | None = None
        self._is_off = False
        self._added = 0
        self._late: Future[list[tuple[Any, ...]]] | None = None
        self._waiting = threading.BoundedSemaphore(_MOST_WAITING)
        self._tasks: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="cipv-detections", daemon=True)
        self._thread.start()

    def get(self, mark: bytes, detector: str) -> RawBoxes | RawLanes | None:
        """The detections in the image with this ``seen_mark``; None if they are not kept, or not found in time."""
        late = self._late
        if self._is_off or (late is not None and not late.done()):
            return None
        sought: Future[list[tuple[Any, ...]]] = Future()
        key = _key(mark, detector)
        self._tasks.put(
            lambda: sought.set_result(self._execute("SELECT answer FROM detections WHERE mark = ?", (key,)))
        )
        try:
            held = sought.result(_ANSWER_S)
        except TimeoutError:
            self._late = sought
            return None
        if not held:
            return None
        try:
            packed = zlib.decompress(held[0][0])
            return answer_of(msgspec.msgpack.decode(packed, type=DetectionRow))
        except (msgspec.DecodeError, zlib.error, ValueError):
            return None

    def put(self, mark: bytes, detector: str, answer: RawBoxes | RawLanes) -> None:
        """Keep the detections in an image, later on; or not, if too many wait for the disk."""
        if self._is_off or not self._waiting.acquire(blocking=False):
            return
        packed = zlib.compress(msgspec.msgpack.encode(row_of(0, detector, answer)), _LEVEL)
        key = _key(mark, detector)
        self._tasks.put(lambda: self._store(key, packed))

    def drop_oldest(self) -> None:
        """Drop the oldest detections if all of them take more space than permitted, after what waits is written."""
        self._tasks.put(self._drop_oldest)

    def close(self) -> None:
        """Write what waits, and close the file; later calls find nothing. A disk that hangs is not waited for."""
        self._tasks.put(None)
        self._thread.join(_CLOSING_S)
        self._is_off = True

    # ------------------------------------------------------------ on its thread

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            task()
        self._is_off = True
        if self._database is not None:
            self._database.close()

    def _store(self, key: bytes, packed: bytes) -> None:
        self._waiting.release()
        self._execute("INSERT OR REPLACE INTO detections (mark, answer) VALUES (?, ?)", (key, packed))
        self._added += 1
        if self._added % _LOOK_EVERY == 0:
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        taken = self._execute("SELECT coalesce(sum(length(answer)), 0), count(*) FROM detections")
        if taken and taken[0][0] > self._most_bytes:
            over = 1.0 - (1.0 - _DROPPED_SHARE) * self._most_bytes / taken[0][0]
            self._execute(
                "DELETE FROM detections WHERE rowid IN (SELECT rowid FROM detections ORDER BY rowid LIMIT ?)",
                (max(1, int(over * taken[0][1])),),
            )

    def _execute(self, sql: str, values: Iterable[object] = ()) -> list[tuple[Any, ...]]:
        if self._is_off:
            return []
        try:
            if self._database is None:
                self._database = self._open()
            with self._database:
                return self._database.execute(sql, tuple(values)).fetchall()
        except sqlite3.OperationalError as error:  # busy, full or read-only: may pass
            logger.debug("%s: %s", self._file, error)
        except (sqlite3.Error, OSError) as error:
            logger.warning("%s: detections are not cached: %s", self._file, error)
            self._is_off = True
        return []

    def _open(self) -> sqlite3.Connection:
        self._file.parent.mkdir(parents=True, exist_ok=True)
        database = sqlite3.connect(self._file, timeout=_BUSY_S, check_same_thread=False)
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA synchronous = OFF")  # after a crash of the system, networks run again
        database.execute("CREATE TABLE IF NOT EXISTS detections (mark BLOB UNIQUE NOT NULL, answer BLOB NOT NULL)")
        return database


def _key(mark: bytes, detector: str) -> bytes:
    return hashlib.blake2b(b"\0".join([mark, detector.encode(), _code_mark()]), digest_size=16).digest()


@cache
def _code_mark() -> bytes:
    """Changes with the code that prepares images and decodes outputs, and with the libraries that run networks."""
    digest = hashlib.blake2b(f"{version('onnxruntime')} {version('opencv-python-headless')}".encode(), digest_size=16)
    for package in _CODE:
        for file in sorted((Path(pipeline.__file__).parent / package).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.digest()
