"""Detections of a recording, cached in the batch's store: a network processes each image once, whatever the
parameters, and several workers share the images of a long recording."""

from __future__ import annotations

import hashlib
from typing import cast

import msgspec
import numpy as np
import zstandard

from app.fleet.store import Store
from pipeline.detection import Detectors, Detects, Seen, look
from pipeline.types import U8, DistanceLaw, Frame, RawBoxes, RawLanes

PIECE_FRAMES = 600
"""Number of frames whose detections are stored in one file: a minute at 10 Hz."""
_LEVEL = 3
Answers = dict[tuple[int, str], RawBoxes | RawLanes]
"""By frame and detector."""


class _Law(msgspec.Struct, array_like=True):
    coefficient: float
    exponent: float
    focal_px: float
    truck_ratio: float
    bus_ratio: float
    motorcycle_ratio: float


class _Answer(msgspec.Struct, array_like=True):
    """One detector's output for one image. boxes and the following fields: of ``RawBoxes``; points and line: of
    ``RawLanes``. Arrays are bytes, little-endian."""

    index: int
    detector: str
    model: str
    scores: bytes
    boxes: bytes | None = None
    labels: list[str] = []
    law: _Law | None = None
    far: tuple[int, int, int, int] | None = None
    far_count: int = 0
    points: bytes = b""
    line: bytes = b""


def answers_file(mark: str, detectors: Detectors, first: int, piece_frames: int = PIECE_FRAMES) -> str:
    """Store name of these detectors' detections in a piece of a recording that begins with frame ``first``."""
    asked = [*detectors.names, detectors.lanes_every, detectors.far_every, piece_frames]
    digest = hashlib.sha256(repr(asked).encode()).hexdigest()[:12]
    return f"boxes/{mark}/{digest}/{first:08d}.bin"


class KeptLook:
    """A ``Look`` that reads known detections from the store, piece by piece, and saves new ones. Frames must come in
    order and on one thread. Call ``close`` at the end."""

    def __init__(self, store: Store, mark: str, detectors: Detectors, piece_frames: int = PIECE_FRAMES) -> None:
        self._store, self._piece_frames = store, piece_frames
        self._name = lambda first: answers_file(mark, detectors, first, piece_frames)
        self._first: int | None = None
        self._known: Answers = {}
        self._has_new = False
        self.asked = 0
        """Number of images that a network had to process."""

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        self._turn_to(frame.index - frame.index % self._piece_frames)
        key = frame.index, detector.name
        known = self._known.get(key)
        if known is None:
            self.asked += 1
            known = self._known[key] = look(detector, frame, bgr)
            self._has_new = True
        return cast("Seen", known)

    def close(self) -> None:
        """Write new detections."""
        if self._first is not None and self._has_new:
            self._store.write(self._name(self._first), packed(self._known))
        self._has_new = False

    def _turn_to(self, first: int) -> None:
        if first == self._first:
            return
        self.close()
        held = self._store.read(self._name(first))
        self._first, self._known = first, unpacked(held) if held is not None else {}


def packed(answers: Answers) -> bytes:
    """As one file; equal detections give equal bytes."""
    rows = [_row(index, name, answer) for (index, name), answer in sorted(answers.items(), key=lambda each: each[0])]
    return zstandard.ZstdCompressor(level=_LEVEL).compress(msgspec.msgpack.encode(rows))


def unpacked(data: bytes) -> Answers:
    """What ``packed`` wrote; empty if it cannot be read, so that networks run again."""
    try:
        rows = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data), type=list[_Answer])
        return {(row.index, row.detector): _answer(row) for row in rows}
    except (msgspec.DecodeError, zstandard.ZstdError, ValueError):
        return {}


def _row(index: int, name: str, answer: RawBoxes | RawLanes) -> _Answer:
    if isinstance(answer, RawLanes):
        points, line = answer.points.astype("<f4").tobytes(), answer.line.astype("<i4").tobytes()
        return _Answer(index, name, answer.model, answer.scores.astype("<f4").tobytes(), points=points, line=line)
    law = answer.law
    numbers = (law.coefficient, law.exponent, law.focal_px, law.truck_ratio, law.bus_ratio, law.motorcycle_ratio)
    return _Answer(
        index,
        name,
        answer.model,
        answer.scores.astype("<f4").tobytes(),
        answer.boxes.astype("<f4").tobytes(),
        list(answer.labels),
        _Law(*numbers),
        answer.far,
        answer.far_count,
    )


def _answer(row: _Answer) -> RawBoxes | RawLanes:
    scores = np.frombuffer(row.scores, "<f4").astype(np.float32)
    if row.boxes is None:
        points = np.frombuffer(row.points, "<f4").astype(np.float32).reshape(-1, 2)
        return RawLanes(row.model, points, scores, np.frombuffer(row.line, "<i4").astype(np.int32))
    boxes = np.frombuffer(row.boxes, "<f4").astype(np.float32).reshape(-1, 4)
    assert row.law is not None
    law = DistanceLaw(*msgspec.structs.astuple(row.law))
    return RawBoxes(row.model, boxes, scores, tuple(row.labels), law, row.far, row.far_count)
