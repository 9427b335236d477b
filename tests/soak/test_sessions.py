"""Sessions as long and as large as real ones, made and read under a memory limit; recordings killed again and again.

The files are made for the test and removed with it. Writes build/sessions.json.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.recording.rewrite import recover
from pipeline.recording.session.source import SessionSource
from tests.conftest import ROOT

pytestmark = pytest.mark.soak

LIMIT_BYTES = 1 << 30
SEEK_LIMIT_MS = 100.0
KILLS = 12

_WRITE = """
import resource, sys
from dataclasses import replace
from pathlib import Path
import cv2, numpy as np
from pipeline.recording.session.writer import SessionWriter
from pipeline.types import CameraImage
from tests.pipeline.recording.frames import ABOUT, PERIOD_NS, full, sweep

path, frames, limit = sys.argv[1], *map(int, sys.argv[2:])
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
random = np.random.default_rng(0)
smooth = cv2.resize(random.integers(0, 255, (45, 80, 3)).astype(np.float32), (1280, 720))
bgr = (smooth + random.normal(0.0, 12.0, smooth.shape)).clip(0.0, 255.0).astype(np.uint8)
jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
cloud = replace(sweep(0, points=28_000), time_s=np.linspace(-0.05, 0.05, 28_000, dtype=np.float32))
writer = SessionWriter(Path(path), ABOUT, compression="lz4")
for index in range(frames):
    t_ns = PERIOD_NS * (1 + index)
    shown = replace(cloud, t_ns=t_ns, points=cloud.points.copy())  # the same array would be stored once
    writer.write(replace(full(index), sweep=shown, image=CameraImage(t_ns, bgr, jpeg)), {"frame": index})
writer.close()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""

_READ = """
import json, resource, sys, time
from pathlib import Path
import numpy as np
from pipeline.recording.info import info
from pipeline.recording.session.source import SessionSource

path, limit = sys.argv[1], int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
began = time.perf_counter()
session = SessionSource("a", path)
opened_s = time.perf_counter() - began
seeks_ms, cpu_ms = [], []
for index in np.random.default_rng(1).integers(0, len(session), 300).tolist():
    began, spent = time.perf_counter(), time.process_time()
    frame = session.frame(index)
    seeks_ms.append((time.perf_counter() - began) * 1e3)
    cpu_ms.append((time.process_time() - spent) * 1e3)
    assert frame.notes == ("gnss silent for 1.0 s (antenna?)",), frame.notes
    assert frame.t_ns == 100_000_000 * (1 + index)
    assert frame.sweep.t_ns == frame.image.t_ns == frame.t_ns
found = info(Path(path))
print(json.dumps({
    "GB": round(found.bytes / 1e9, 2), "hours": round(found.duration_s / 3600, 3), "frames": len(session),
    "chunks": found.chunks, "open_s": round(opened_s, 3), "seek_median_ms": round(float(np.median(seeks_ms)), 2),
    "seek_p99_ms": round(float(np.percentile(seeks_ms, 99)), 2), "seek_max_ms": round(max(seeks_ms), 2),
    "seek_cpu_p99_ms": round(float(np.percentile(cpu_ms, 99)), 2),
    "read_peak_MB": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1),
}))
"""


def run(script: str, *arguments: object) -> str:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def report(name: str, figures: dict[str, object]) -> None:
    file = ROOT / "build" / "sessions.json"
    file.parent.mkdir(exist_ok=True)
    every = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    file.write_text(json.dumps({**every, name: figures}, indent=1) + "\n", encoding="utf-8")
    print(name, figures)


FRAMES = 36_000
FRAME_BYTES = 900_000, 1_200_000
"""A full sweep of a VLP-16 (28,000 points) and an image of 1280×720."""


@pytest.mark.timeout(3600)
def test_any_frame_of_an_hour_is_near_and_memory_is_bounded(tmp_path: Path) -> None:
    """An hour of full sweeps and images at 10 Hz, 36 GB: larger than the page cache."""
    free = shutil.disk_usage(tmp_path).free
    if free < 1.1 * FRAMES * FRAME_BYTES[1]:
        pytest.skip(f"an hour of full frames takes 36 GB, and {free / 1e9:.0f} GB are free in {tmp_path}")
    path = tmp_path / "large.mcap"
    try:
        written = int(run(_WRITE, path, FRAMES, LIMIT_BYTES))
        size = path.stat().st_size
        figures = json.loads(run(_READ, path, LIMIT_BYTES))
    finally:
        path.unlink(missing_ok=True)
    report("one hour", {**figures, "write_peak_MB": round(written / 2**20, 1), "cores": len(os.sched_getaffinity(0))})
    assert figures["frames"] == FRAMES
    assert FRAME_BYTES[0] < size / FRAMES < FRAME_BYTES[1]
    assert figures["chunks"] < 1.1 * FRAMES, "a seek reads the frame and nothing else"
    assert figures["seek_p99_ms"] < SEEK_LIMIT_MS


_RECORD_FOR_EVER = """
import sys
from dataclasses import replace
from pathlib import Path
from pipeline.recording.recorder import Recorder
from tests.pipeline.recording.frames import ABOUT, full, sweep
recorder = Recorder(Path(sys.argv[1]), ABOUT)
points = sweep(0, points=3000)
for index in range(10**9):
    recorder.put(replace(full(index), sweep=points))
    if index % 20 == 0:
        print(recorder.state.bytes, flush=True)
"""


@pytest.mark.timeout(600)
def test_killed_again_and_again(tmp_path: Path) -> None:
    """After any number of bytes up to 6 MB, every frame in a complete chunk is readable."""
    random, saved = np.random.default_rng(2), []
    for kill in range(KILLS):
        path, out = tmp_path / f"{kill}.mcap", tmp_path / f"{kill}_recovered.mcap"
        command = [sys.executable, "-c", _RECORD_FOR_EVER, str(path)]
        with subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as process:
            assert process.stdout is not None
            enough, written = int(random.integers(600_000, 6_000_000)), 0
            while written < enough:
                written = int(process.stdout.readline())
            os.kill(process.pid, signal.SIGKILL)
        found = recover(path, out)
        assert found.is_cut
        assert found.lost_chunks == 0
        assert found.sound_bytes >= written
        session = SessionSource("a", str(out))
        for index in range(len(session)):
            assert session.frame(index).sweep is not None
        saved.append(len(session))
    report("kills", {"kills": KILLS, "frames_saved": saved})
