"""Memory does not grow over a drive played again and again, from source to the message that browsers get."""

from __future__ import annotations

import gc
import json
import os
from pathlib import Path

import pytest

from app.core.detection_cache import DetectionCache
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.vision.detector import Detector, open_detector
from tests.conftest import ROOT

PAGE = os.sysconf("SC_PAGE_SIZE")
ALLOWED_SHARE = 0.02
ALLOWED_BYTES = 8e6
"""One or two malloc arenas; a frame's image alone is 3 MB."""


def resident_bytes() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def play(pipeline: SeekablePipeline, encoder: Encoder, frames: range) -> int:
    """Play one round; returns the number of bytes that a browser would receive."""
    sent = 0
    for index in frames:
        tick = pipeline.advance(index, Params())
        message = encoder.message(Snapshot(Params(), processed=tick, index=index))
        sent += len(message or b"")
    return sent


def growth(uri: str, detector: Detector | None, frames: int | None, warm_up: int, rounds: int) -> tuple[float, int]:
    """Growth in bytes after the first ``warm_up`` rounds, and the resident size at that time."""
    source = open_source(uri)
    pipeline, encoder = SeekablePipeline(source, Detectors(detector), DetectionCache(), "both"), Encoder()
    shown = range(min(frames or len(source), len(source)))
    for _ in range(warm_up):
        assert play(pipeline, encoder, shown) > 10_000 * len(shown)
    before = resident_bytes()
    for _ in range(rounds):
        play(pipeline, encoder, shown)
    return resident_bytes() - before, before


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident size is read from /proc")
def test_a_short_drive_looped() -> None:
    grown, before = growth("sim:straight", None, frames=12, warm_up=4, rounds=12)
    assert grown < max(ALLOWED_SHARE * before, ALLOWED_BYTES)


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_real_drive_looped_100_times(data_dir: Path) -> None:
    detector = open_detector(str(data_dir / "models" / "yolox_nano.onnx"), (2048, 618))
    grown, before = growth(f"astyx:{data_dir / 'astyx'}", detector, frames=None, warm_up=5, rounds=100)
    report = {"rounds": 100, "frames": 39, "resident_MB": round(before / 1e6, 1), "grown_MB": round(grown / 1e6, 2)}
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / "soak.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(report)
    assert grown < max(ALLOWED_SHARE * before, ALLOWED_BYTES)
