"""Detections of a recording, cached in the batch's store: a network processes each image once, whatever the
parameters, and several workers share the images of a long recording."""

from __future__ import annotations

import hashlib
from typing import cast

import msgspec
import zstandard

from app.core.kept_detections import DetectionRow, answer_of, row_of
from app.fleet.store import Store
from pipeline.detection import Detectors, Detects, Seen, look
from pipeline.types import U8, Frame, RawBoxes, RawLanes

PIECE_FRAMES = 600
"""Number of frames whose detections are stored in one file: a minute at 10 Hz."""
_LEVEL = 3
_LARGEST_BYTES = 256 << 20
"""Unpacked size of one file: 50 times that of a minute at 10 Hz, of some 5 kB per image and two networks."""
Answers = dict[tuple[int, str], RawBoxes | RawLanes]
"""By frame and detector."""


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
    rows = [row_of(index, name, answer) for (index, name), answer in sorted(answers.items(), key=lambda each: each[0])]
    return zstandard.ZstdCompressor(level=_LEVEL).compress(msgspec.msgpack.encode(rows))


def unpacked(data: bytes) -> Answers:
    """What ``packed`` wrote; empty if it cannot be read, so that networks run again."""
    try:
        if zstandard.frame_content_size(data) > _LARGEST_BYTES:  # memory for it would be allocated
            return {}
        rows = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data), type=list[DetectionRow])
        return {(row.index, row.detector): answer_of(row) for row in rows}
    except (msgspec.DecodeError, zstandard.ZstdError, ValueError):
        return {}
