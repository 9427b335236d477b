"""A recorder in a chaos soak, which is killed, or whose disk is full."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time
from pathlib import Path

from pipeline.recording import topics
from pipeline.recording.mcap.chain import verify
from pipeline.recording.rewrite import recover
from pipeline.recording.session.messages import log_text
from pipeline.recording.session.source import SessionSource
from tests.conftest import ROOT
from tests.pipeline.recording.frames import PERIOD_NS
from tests.soak.chaos.figures import Figures

_FULL_S = 600.0
"""A disk is full after a second. A machine whose processors are taken needs minutes to start Python."""

_RECORD = """
import resource, sys, time
from dataclasses import replace
from pathlib import Path
from pipeline.recording.recorder import Recorder
from tests.pipeline.recording.frames import ABOUT, full, sweep
recorder, points = Recorder(Path(sys.argv[1]), ABOUT, queued=4), sweep(0, points=20_000)
size = int(sys.argv[2])
if size:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
for index in range(10**9):
    recorder.put(replace(full(index), sweep=replace(points, points=points.points.copy())))
    time.sleep(0.004 * (index % 20 == 0))
    if recorder.state.error:
        print(recorder.state.error, flush=True)
        break
"""


def record(folder: Path, chance: random.Random, figures: Figures) -> None:
    """Record faster than the disk can write, until the recorder is killed or its disk is full; then read it back."""
    path, is_full = folder / "a.mcap", chance.random() < 0.5
    path.unlink(missing_ok=True)
    limit = chance.randint(2_000_000, 20_000_000) if is_full else 0
    command = [sys.executable, "-c", _RECORD, str(path), str(limit)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        if is_full:
            told, _ = process.communicate(timeout=_FULL_S)
            if "recording stopped" not in told:
                figures.wrong.append("a full disk is not said")
        else:
            while not path.exists() or path.stat().st_size < 1_000_000:
                time.sleep(0.05)
            time.sleep(chance.uniform(0.0, 1.0))
            process.kill()
    figures.befell["disk full" if is_full else "recorder killed"] += 1
    figures.sessions += 1
    figures.frames += read_back(path, figures)


def read_back(path: Path, figures: Figures) -> int:
    """Number of frames; checks that each is complete and that missing frames are reported."""
    out = path.with_name("b.mcap")
    out.unlink(missing_ok=True)
    if verify(path).state != "cut off":
        figures.wrong.append(f"a session that was cut: {verify(path)}")
    recover(path, out)
    session = SessionSource("a", str(out))
    times = [session.frame(index).t_ns for index in range(len(session))]
    missing = (times[-1] - times[0]) // PERIOD_NS + 1 - len(times)
    texts = (log_text(topics.NOTES, stored.data) for stored in session.file.messages((topics.NOTES,)))
    said = sum(int(found[1]) for text in texts if (found := re.search(r"(\d+) frames", text)))
    if missing > said:
        figures.wrong.append(f"{missing} frames are missing, {said} are said")
    session.close()
    return len(times)
