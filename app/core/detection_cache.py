"""Caches detections, so that no network processes the same image twice."""

from __future__ import annotations

import threading
from time import perf_counter
from typing import Protocol, cast

from app.core.kept_detections import KeptDetections, seen_mark
from app.core.lru import BoundedCache
from pipeline.common.watchdog import NETWORK, at_work
from pipeline.detection import Detects, Seen
from pipeline.sources.fingerprint import fingerprint
from pipeline.types import U8, CameraImage, Frame, RawBoxes, RawLanes

_CACHED_ANSWERS = 12288


class Named(Protocol):
    """A detector whose outputs are cached."""

    @property
    def name(self) -> str:
        """Equal names give equal outputs."""
        ...


class DetectionCache:
    """Detections by (source, frame, detector), with bounded memory. It outlives the source, so that reopening a
    recording runs no network unless its files have changed. Any thread.

    kept: detections of earlier starts, by the content of their image; None to keep nothing."""

    def __init__(self, limit: int = _CACHED_ANSWERS, kept: KeptDetections | None = None) -> None:
        self.kept = kept
        self._lock = threading.Lock()
        self._answers: BoundedCache[tuple[str, int, str], RawBoxes | RawLanes] = BoundedCache(limit, lambda _: 1)

    def look_at(self, uri: str) -> CachedLook:
        """A detector call for the images of one source, in the current version of its files."""
        return CachedLook(self, fingerprint(uri))

    def get(self, key: tuple[str, int, str]) -> RawBoxes | RawLanes | None:
        """An output by (source and image, frame, detector); None if it is not cached."""
        with self._lock:
            return self._answers.get(key)

    def put(self, key: tuple[str, int, str], answer: RawBoxes | RawLanes) -> None:
        """Store an output; the oldest are dropped when memory is full."""
        with self._lock:
            self._answers.put(key, answer)

    def close(self) -> None:
        """Write what is to be kept and is not written yet, and close its file."""
        if self.kept is not None:
            self.kept.close()


class CachedLook:
    """A ``pipeline.run.Look`` that checks the cache first. For one thread; ``clone`` it for another."""

    def __init__(self, cache: DetectionCache, source: str) -> None:
        self.spent_ms = 0.0
        """Total time that detectors have run, in milliseconds."""
        self._cache, self._source = cache, source
        self._last: tuple[CameraImage | None, bytes | None] | None = None

    def clone(self) -> CachedLook:
        """A copy for another thread."""
        return CachedLook(self._cache, self._source)

    def knows(self, detector: Named, index: int) -> bool:
        """Whether the detections of a frame are in the cache."""
        return self._cache.get((self._source, index, detector.name)) is not None

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        key = (self._source, frame.index, detector.name)
        held = self._cache.get(key)
        if held is not None:
            return cast("Seen", held)
        found = self._kept(detector, frame)
        if found is None:
            start = perf_counter()
            with at_work(NETWORK + detector.name):
                found = detector.detect(bgr)
            self.spent_ms += (perf_counter() - start) * 1e3
            self._keep(detector, frame, found)
        self._cache.put(key, found)
        return found

    def _kept(self, detector: Detects[Seen], frame: Frame) -> Seen | None:
        """The detections of an earlier start; None if there are none."""
        mark = self._mark_of(frame)
        if self._cache.kept is None or mark is None:
            return None
        return cast("Seen | None", self._cache.kept.get(mark, detector.name))

    def _keep(self, detector: Named, frame: Frame, found: RawBoxes | RawLanes) -> None:
        mark = self._mark_of(frame)
        if self._cache.kept is not None and mark is not None:
            self._cache.kept.put(mark, detector.name, found)

    def _mark_of(self, frame: Frame) -> bytes | None:
        """``seen_mark``, once for all detectors of a frame; None where nothing is kept."""
        if self._cache.kept is None:
            return None
        last = self._last
        if last is None or last[0] is not frame.image:
            last = self._last = (frame.image, seen_mark(frame))
        return last[1]
