"""What a soak of live sensors watches: each frame that is shown, and the memory of this process."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from pipeline.types import Frame

PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass
class Shown:
    """One frame as it was shown. at_s: when its result was ready, after the car's start."""

    at_s: float
    has: dict[str, bool]
    stages_ms: dict[str, float]
    lead_m: float | None


@dataclass
class Watcher:
    """Listens to the engine as the server does: encodes each frame, and keeps its figures."""

    start_ns: int = 0
    shown: list[Shown] = field(default_factory=list)
    errors: set[str] = field(default_factory=set)
    encoded_bytes: int = 0
    encoder: Encoder = field(default_factory=Encoder)
    _sequence: int = 0

    def __call__(self, snapshot: Snapshot) -> None:
        tick = snapshot.processed
        self.errors |= {notice.text for notice in snapshot.notices if notice.level == "error"}
        if tick is None or snapshot.sequence == self._sequence:
            return
        self._sequence = snapshot.sequence
        begun = time.perf_counter()
        self.encoded_bytes += len(self.encoder.message(snapshot) or b"")
        encode_ms = (time.perf_counter() - begun) * 1e3
        result, made_ns = tick.result, snapshot.made_unix_s * 1e9
        timing = result.timing_ms
        stages = {name: timing[name] for name in ("arrival", "waiting", "picture")}
        stages |= {"networks": tick.detect_ms, "line": timing["total"], "encode": encode_ms}
        stages["sensor to result"] = (made_ns - tick.frame.t_ns) / 1e6
        lead = result.cipv.distance_m if result.cipv is not None else None
        self.shown.append(Shown((made_ns - self.start_ns) / 1e9, _has(tick.frame), stages, lead))


def _has(frame: Frame) -> dict[str, bool]:
    return {"lidar": frame.sweep is not None, "camera": frame.image is not None, "gnss": frame.gnss is not None}


class Memory:
    """Resident bytes of this process, every half second."""

    def __init__(self) -> None:
        self.samples: list[tuple[float, int]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample)
        self._thread.start()

    def _sample(self) -> None:
        while not self._stop.wait(0.5):
            resident = int(Path("/proc/self/statm").read_text().split()[1]) * PAGE
            self.samples.append((time.time(), resident))

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()

    def grown(self) -> tuple[float, float]:
        """Growth in bytes from the second fifth to the last, and the size in the second; medians, so that one frame
        more or less in the recorder's queue does not matter."""
        values = np.array([resident for _, resident in self.samples], dtype=np.float64)
        fifth = max(1, len(values) // 5)
        before, after = np.median(values[fifth : 2 * fifth]), np.median(values[-fifth:])
        return float(after - before), float(before)
