"""Copies what a store lacks of a folder of sessions: event clips first, then sessions, the oldest first.

In the store, ``events/NAME-FRAME.mcap`` are the clips of a session and ``events/NAME.json`` says what happened in it;
``sessions/NAME.mcap`` is the session and ``sessions/NAME.mcap.sha256`` marks it as complete. After each file the folder
is looked at again, so that the clips of a session that has just ended come before older sessions.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from app.drive.events.event import Severity
from app.fleet.store import Store
from app.fleet.sync.event_clips import clips_around, recorded_events, write_clip
from app.fleet.sync.local_sessions import LocalSession, LocalSessions, SessionFolder
from app.fleet.sync.pace import Pace
from app.fleet.sync.sending import NotSent, sender, sha256_of, sha256_there
from pipeline.common.progress import Progress
from pipeline.params import Params
from pipeline.recording.session.source import SessionSource
from pipeline.types.source import SourceError

Begin = Callable[[str, int], Progress]
"""Called with what is sent next and its bytes; returns the callback for its progress."""


@dataclass(frozen=True)
class SyncOptions:
    """What is copied, and how fast."""

    clips: bool = True
    """Whether clips of events are cut and sent first."""
    least: Severity = "warning"
    """The mildest events that get a clip; marks always do."""
    around_s: float = 5.0
    """Seconds before and after an event."""
    bytes_per_s: float | None = None
    """The most that is sent; None for no limit."""
    verify: bool = False
    """Whether the copies of sessions that are there already are read back and compared with their checksums."""


@dataclass
class SyncTally:
    """What a run has done."""

    sessions: int = 0
    """Sessions sent."""
    clips: int = 0
    """Clips sent."""
    bytes: int = 0
    """Of these."""
    before: int = 0
    """Sessions that the store had already."""
    unfinished: list[str] = field(default_factory=list)
    """Files that are being recorded, or were cut off: not copied."""
    notes: dict[str, str] = field(default_factory=dict)
    """Session → why it has no clips."""
    failed: dict[str, str] = field(default_factory=dict)
    """Session → why it was not copied."""
    damaged: list[str] = field(default_factory=list)
    """Sessions whose copy was damaged, and is sent again."""


class Sync:
    """One run.

    Args:
        folder: that sessions are recorded to.
        store: that they are copied to.
        options: see there.
        begin: see ``Begin``.
        tally: filled in as the run proceeds.

    Raises:
        BadInput: there is no such folder, or the store cannot be written to. Overloaded: it keeps failing.
    """

    def __init__(self, folder: Path, store: Store, options: SyncOptions, begin: Begin, tally: SyncTally) -> None:
        self.tally = tally
        self._folder = SessionFolder(folder, except_in=store.folder)
        self._store, self._options, self._begin = store, options, begin
        self._sender, self._pace = sender(store), Pace(options.bytes_per_s)
        self._there = store.sizes("")

    def run(self) -> None:
        """Copy until nothing is left. Raises StoreFailed, NotReachable and Overloaded: another run continues there."""
        local = self._folder.look()
        if self._options.verify:
            self._verify(local)
        self.tally.before = len(local.finished) - len(self._missing(local))
        while (act := self._next(local)) is not None:
            session, do = act
            try:
                do(session)
            except NotSent as error:
                self.tally.failed[session.name] = str(error)
            local = self._folder.look()
        self.tally.unfinished = list(local.unfinished)

    def _next(self, local: LocalSessions) -> tuple[LocalSession, Callable[[LocalSession], None]] | None:
        missing = [each for each in self._missing(local) if not self._is_refused(each)]
        if self._options.clips:
            for each in missing:
                if _events_file(each) not in self._there and each.name not in self.tally.notes:
                    return each, self._send_clips
        return (missing[0], self._send_session) if missing else None

    def _missing(self, local: LocalSessions) -> list[LocalSession]:
        """Those that are not in the store as they are here."""
        return [
            each
            for each in local.finished
            if _mark_file(each) not in self._there or self._there.get(_session_file(each)) != each.bytes
        ]

    def _verify(self, local: LocalSessions) -> None:
        """Read back the copies that seem complete. A damaged one counts as missing if the session here is what was
        sent; else neither can be trusted."""
        missing = self._missing(local)
        for each in (each for each in local.finished if each not in missing):
            marked = (self._store.read(_mark_file(each)) or b"").split(b" ")[0].decode(errors="replace")
            told = self._begin(f"checking {each.name}", each.bytes)
            there = sha256_there(self._store, _session_file(each), each.bytes, told)
            if there == marked:
                continue
            if sha256_of(each.file) == marked:
                del self._there[_mark_file(each)]
                self.tally.damaged.append(each.name)
            else:
                self.tally.failed[each.name] = (
                    f"{self._store.address}/{_session_file(each)} is damaged, and {each.file} is not what was sent"
                )

    def _is_refused(self, session: LocalSession) -> bool:
        """Whether a session cannot be copied. One of its name in the store is not replaced: it is another car's."""
        if session.name not in self.tally.failed and _mark_file(session) in self._there:
            there = f"{self._store.address}/{_session_file(session)}"
            self.tally.failed[session.name] = f"{there} is another recording; give each car an address of its own"
        return session.name in self.tally.failed

    def _send_session(self, session: LocalSession) -> None:
        name = _session_file(session)
        sha256 = self._sender.send(name, session.file, self._pace, self._begin(session.name, session.bytes))
        self._put(_mark_file(session), f"{sha256}  {Path(name).name}\n".encode())
        self._there[name] = session.bytes
        self.tally.sessions, self.tally.bytes = self.tally.sessions + 1, self.tally.bytes + session.bytes

    def _send_clips(self, session: LocalSession) -> None:
        """The clips of a session, then what happened in it, which marks them as complete."""
        try:
            source = SessionSource(str(session.file), str(session.file))
        except SourceError as error:
            self.tally.notes[session.name] = f"no clips: {error}"
            return
        with tempfile.TemporaryDirectory(prefix="cipv-sync-") as folder:
            said = self._cut_and_send(session, source, Path(folder))
        self._put(_events_file(session), json.dumps(said, ensure_ascii=False, indent=1).encode())

    def _cut_and_send(self, session: LocalSession, source: SessionSource, folder: Path) -> dict[str, object]:
        options, told = self._options, self._begin(f"events of {session.name}", session.bytes)
        try:
            frames = [source.t_ns(index) for index in range(len(source))]
            gap_s = (source.params(0) or Params()).time.reset_gap_s
            events = recorded_events(source, options.least, told)
            listed = []
            for wanted in clips_around(frames, events, options.around_s, gap_s):
                name = f"events/{session.name}-{wanted.first:06d}.mcap"
                file = folder / "clip.mcap"
                write_clip(source, wanted, file)
                size = file.stat().st_size
                sha256 = self._sender.send(name, file, self._pace, self._begin(Path(name).stem, size))
                file.unlink()
                self._there[name] = size
                self.tally.clips, self.tally.bytes = self.tally.clips + 1, self.tally.bytes + size
                happened = [each.to_json((frames[each.index] - frames[0]) / 1e9) for each in wanted.events]
                listed.append(
                    {"clip": name, "sha256": sha256, "first": wanted.first, "last": wanted.last, "events": happened}
                )
        finally:
            source.close()
        return {"session": session.name, "frames": len(frames), "clips": listed}

    def _put(self, name: str, data: bytes) -> None:
        self._store.write(name, data)
        self._there[name] = len(data)


def _session_file(session: LocalSession) -> str:
    return f"sessions/{session.name}.mcap"


def _mark_file(session: LocalSession) -> str:
    """Its presence means that the session has arrived whole."""
    return f"{_session_file(session)}.sha256"


def _events_file(session: LocalSession) -> str:
    return f"events/{session.name}.json"
