"""A server in a chaos soak, in which somebody labels, and all that befalls it and its database."""

from __future__ import annotations

import contextlib
import os
import random
import re
import resource
import signal
import threading
import time
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
from tests.app.engine.recording_helpers import Recording
from tests.app.labels.conftest import info
from tests.app.labels.kills import CUBOID
from tests.app.labels.server_process import started
from tests.pipeline.recording.frames import write
from tests.soak.chaos.figures import JUMPS_S, Figures, limited, resident_mb

_ANSWER_S = 20.0
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


def session(path: Path) -> Path:
    """Write the drive that is labelled, which the server reads again whenever it is restarted."""
    recording = Recording(count=_FRAMES)
    return write(path, [recording.frame(index) for index in range(_FRAMES)])


class LabelledServer:
    """A server on one database, restarted whenever it is killed, and a person who labels without a pause."""

    def __init__(self, context: ForkServerContext, url: str, session: Path, figures: Figures) -> None:
        self._context, self.url, self._session, self.figures = context, url, session, figures
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
        self.process, self.address = started(self._context, self.url, self._ahead_s, self._session)

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
        self._ahead_s.value = random.choice(JUMPS_S)

    def use_up_descriptors(self) -> None:
        """Let the server open no file descriptors for two seconds, while it computes its drive."""
        self.kill()
        pid = self.process.pid or 0
        with limited([pid], "nofile", len(os.listdir(f"/proc/{pid}/fd"))):
            time.sleep(2.0)

    def use_up_memory(self) -> None:
        """Let the server get no memory for two seconds, while it computes its drive. It may end of that."""
        self.kill()
        pid = self.process.pid or 0
        size = int(Path(f"/proc/{pid}/statm").read_text().split()[0]) * resource.getpagesize()
        with limited([pid], "as", size):
            time.sleep(2.0)
        if not self.process.is_alive():
            self.figures.befell["server ended without memory"] += 1
            self.start()

    def fill_disk(self) -> None:
        """Let the database write nothing for two seconds: PostgreSQL's processes, or the server for SQLite."""
        children = self._database_processes()
        with limited(children or [self.process.pid or 0], "fsize", 1):
            time.sleep(2.0)

    def kill_database(self) -> None:
        """Kill one of PostgreSQL's processes, after which all restart. Does nothing for SQLite."""
        for child in self._database_processes():
            with contextlib.suppress(OSError):
                if b"tester" in Path(f"/proc/{child}/cmdline").read_bytes():
                    os.kill(child, signal.SIGKILL)
                    return

    def _database_processes(self) -> list[int]:
        """Those of PostgreSQL, except the one that starts them; empty for SQLite."""
        folder = re.search(r"host=(\S+)", self.url)
        if folder is None:
            return []
        main = int((Path(folder[1]) / "data" / "postmaster.pid").read_text().split()[0])
        return [int(child) for child in Path(f"/proc/{main}/task/{main}/children").read_text().split()]

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
        figures.resident_mb.append(resident_mb(self.process.pid or 0))
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
