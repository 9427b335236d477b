"""The participants and the faults of a chaos soak: a server used for labeling, a recorder, and misbehaving clients."""

from __future__ import annotations

import contextlib
import os
import random
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy import select

from app.labels.errors import DatabaseError
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.tables import DriveRow
from pipeline.recording import topics
from pipeline.recording.mcap.chain import verify
from pipeline.recording.rewrite import recover
from pipeline.recording.session.messages import log_text
from pipeline.recording.session.source import SessionSource
from tests.app.labels.conftest import info
from tests.app.labels.kills import CUBOID
from tests.app.labels.server_process import started
from tests.conftest import ROOT
from tests.pipeline.recording.frames import PERIOD_NS

_ANSWER_S = 20.0
_FULL_S = 600.0
"""A disk is full after a second. A machine whose processors are taken needs minutes to start Python."""
_JUMPS_S = (-86_400.0, -30.0, 30.0, 86_400.0)
_FRAMES = 30
_MOST_TRACKS = 500
_PLACE = {"cuboid": CUBOID}
_RECOVERY_S = 60.0
"""PostgreSQL's own recovery after a process was killed, on a machine whose processors and memory are taken."""


def _reached(url: str) -> Database:
    """The database, once it has recovered."""
    deadline = time.monotonic() + _RECOVERY_S
    while True:
        try:
            return Database(url)
        except DatabaseError:
            if time.monotonic() > deadline:
                raise
            threading.Event().wait(0.2)


@dataclass
class Figures:
    """Counts of everything that happened. ``wrong`` must stay empty."""

    befell: Counter[str] = field(default_factory=Counter)
    """Number of faults by kind."""
    acts: int = 0
    """Number of label changes that the server confirmed."""
    refused: int = 0
    """Number of changes that were rejected or not answered."""
    sessions: int = 0
    """Number of sessions that a recorder began, until it was killed or the disk was full."""
    frames: int = 0
    """Of these, read back."""
    drives: int = 0
    """Number of drives of which every final frame was compared."""
    clients: int = 0
    """Number of misbehaving clients."""
    live_ticks: int = 0
    """Number of ticks of live sensors that were shown."""
    live_frames: int = 0
    """Of these, how many were read back from the recording."""
    slowest_return_s: float = 0.0
    """Longest driving time from a check until every live sensor had delivered data again."""
    checks: int = 0
    wrong: list[str] = field(default_factory=list)
    resident_mb: list[float] = field(default_factory=list)
    """Memory of the server at each check."""


class LabelledServer:
    """A server on one database, restarted whenever it is killed, and a person who labels without a pause."""

    def __init__(self, context: ForkServerContext, url: str, figures: Figures) -> None:
        self._context, self.url, self.figures = context, url, figures
        self._ahead_s = context.Value("d", 0.0)
        self.process: BaseProcess
        self.address = ""
        self._said: dict[int, tuple[int, int]] = {}
        self._gone: set[int] = set()
        self._first_rows: dict[str, list[Any]] | None = None
        self._number = 0
        self.start()
        httpx.get(f"{self.address}/api/labels", timeout=_ANSWER_S).raise_for_status()  # adds the drive to the database

    def start(self) -> None:
        self.process, self.address = started(self._context, self.url, self._ahead_s)

    def label(self, stop: threading.Event) -> None:
        """Create one track after another until ``stop``; after each kill, on the next server. Once there are
        ``_MOST_TRACKS``, each new one replaces the oldest, since the size of the labels is not what is tested."""
        while not stop.is_set():
            with httpx.Client(base_url=self.address, timeout=_ANSWER_S) as client:
                try:
                    drive = client.get("/api/labels").json()["drive"]["id"]
                    while not stop.is_set():
                        self._label_once(client, drive)
                        if len(self._said) > _MOST_TRACKS:
                            self._remove_oldest(client, drive)
                except (httpx.HTTPError, KeyError, ValueError):
                    self.figures.refused += 1
                    stop.wait(0.1)

    def _label_once(self, client: httpx.Client, drive: int) -> None:
        frame, self._number = self._number % _FRAMES, self._number + 1
        done = self._done(client, drive, {"kind": "add_track", "label": f"car {self._number}", "frame": frame} | _PLACE)
        if done is not None:
            (track,) = done["changed"]["tracks"]
            self._said[track["id"]] = frame, track["revision"]

    def _remove_oldest(self, client: httpx.Client, drive: str) -> None:
        """If the answer is lost, the track may be there or not, and is not looked for any more."""
        track = next(iter(self._said))
        _, revision = self._said.pop(track)
        item = {"kind": "track", "id": track, "revision": revision}
        if self._done(client, drive, {"kind": "remove", "items": [item]}) is not None:
            self._gone.add(track)

    def _done(self, client: httpx.Client, drive: str, act: dict[str, Any]) -> dict[str, Any] | None:
        """The answer to an act; None if it was refused."""
        answer = client.post("/api/labels/act", json={"person": "Ada", "act": act, "drive": drive})
        if answer.is_success:
            self.figures.acts += 1
            found: dict[str, Any] = answer.json()
            return found
        self.figures.refused += 1
        time.sleep(0.05)
        return None

    # ------------------------------------------------------------ faults

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.start()

    def freeze(self) -> None:
        """Suspend the server, as if the machine slept."""
        os.kill(self.process.pid or 0, signal.SIGSTOP)
        time.sleep(1.5)
        os.kill(self.process.pid or 0, signal.SIGCONT)

    def set_clock(self) -> None:
        self._ahead_s.value = random.choice(_JUMPS_S)

    def use_up_descriptors(self) -> None:
        """Let the server open no file descriptors for two seconds."""
        pid = self.process.pid or 0
        soft, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (len(os.listdir(f"/proc/{pid}/fd")), hard))
        time.sleep(2.0)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (soft, hard))

    def kill_database(self) -> None:
        """Kill one of PostgreSQL's processes, after which all restart. Does nothing for SQLite."""
        folder = re.search(r"host=(\S+)", self.url)
        if folder is None:
            return
        main = int((Path(folder[1]) / "data" / "postmaster.pid").read_text().split()[0])
        for child in Path(f"/proc/{main}/task/{main}/children").read_text().split():
            if b"tester" in Path(f"/proc/{child}/cmdline").read_bytes():
                os.kill(int(child), signal.SIGKILL)
                return

    # ------------------------------------------------------------ checks

    def check(self) -> None:
        """Check that every confirmed change is stored, and that every final frame equals the first computation."""
        figures, said, gone = self.figures, dict(self._said), set(self._gone)
        database = _reached(self.url)
        try:
            with database.reading() as connection:
                key = connection.scalars(select(DriveRow.key)).one()
            changes = DriveLabels(database, info(key, count=_FRAMES)).changes()
            made = {item.id: changes.extents[item.id][0] for item in changes.items}
        finally:
            database.close()
        figures.wrong += [
            f"track {track} is lost"
            for track, (frame, _) in said.items()
            if made.get(track) != frame and track in self._said
        ]
        figures.wrong += [f"track {track} is back" for track in gone & made.keys()]
        rows = self._rows()
        if self._first_rows is None:
            self._first_rows = rows
        figures.wrong += [f"column {name} differs" for name in rows if rows[name] != self._first_rows[name]]
        figures.drives += 1
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        figures.resident_mb.append(round(int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1024, 1))
        figures.checks += 1

    def _rows(self) -> dict[str, list[Any]]:
        with httpx.Client(base_url=self.address, timeout=_ANSWER_S) as client:
            for _ in range(600):
                with contextlib.suppress(httpx.HTTPError):
                    found = client.get("/api/drive").json()
                    if found.get("done") == _FRAMES:
                        return {name: found["columns"][name] for name in _COLUMNS}
                time.sleep(0.1)
        raise AssertionError("the drive is not computed within a minute")


_COLUMNS = ("cipv_id", "source", "distance_m", "closing_speed_mps", "ttc_s", "acc_state", "gaps")

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
    figures.frames += _read_back(path, figures)


def _read_back(path: Path, figures: Figures) -> int:
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
