"""`cipv sync`: copy finished sessions from a car to a store."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from app.commands.info import size_text
from app.commands.support.arguments import option
from app.commands.support.interruption import says_when_interrupted
from app.commands.support.progress_bars import bytes_progress, task_progress
from app.core.session_folder import SESSIONS
from app.core.terminal import one_line
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from pipeline.common.progress import Progress

if TYPE_CHECKING:
    from app.fleet.sync.sync import SyncTally

_CONTINUES = "the next `cipv sync` continues"


@dataclass(frozen=True)
class SyncSessions:
    """Copy finished sessions to a folder or store: clips of events first, then whole sessions, oldest first. Files that
    are already there are not sent again, and an interrupted copy is continued.

    Example: cipv sync s3://fleet/car-7 --limit 1.5
    """

    address: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")]
    """Target: a folder, or an address in a store (s3://, gs://, az://); a different one for each car"""
    folder: Annotated[Path, tyro.conf.arg(name="from", metavar="DIR")] = SESSIONS
    """The folder of sessions"""
    limit: Annotated[float | None, option("MB")] = None
    """Send at most this many megabytes per second"""
    clips: bool = True
    """Send clips of events first"""
    events: Literal["info", "notice", "warning", "alarm"] = "warning"
    """Lowest severity of events that get a clip; marks always get one"""
    around: Annotated[float, tyro.conf.arg(metavar="S")] = 5.0
    """Length of a clip before and after its event, in seconds"""
    verify: bool = False
    """Read back the sessions that are already there, and send those again that are damaged"""
    json: bool = False
    """Print what was done as JSON"""

    def __call__(self) -> int:
        from app.fleet.store import Store
        from app.fleet.sync.sending import StoreFailed
        from app.fleet.sync.sync import Sync, SyncOptions, SyncTally

        if self.limit is not None and not self.limit > 0.0:
            raise BadInput(f"--limit {self.limit:g}: expected more than 0")
        if not 0.0 <= self.around <= 3600.0:
            raise BadInput(f"--around {self.around:g}: expected 0 to 3600")
        limit_bytes = self.limit * 1e6 if self.limit is not None else None
        options = SyncOptions(self.clips, self.events, self.around, limit_bytes, self.verify)
        start, stopped = time.monotonic(), ""
        with says_when_interrupted(_CONTINUES), bytes_progress() as bar:

            def begin(what: str, size: int) -> Progress:
                for task in bar.tasks:
                    bar.remove_task(task.id)
                return task_progress(bar, what, size)

            tally = SyncTally()
            try:
                Sync(self.folder, Store(self.address), options, begin, tally).run()
            except (StoreFailed, Overloaded) as error:
                stopped = str(error)
        self._tell(tally, time.monotonic() - start, stopped)
        return 1 if stopped or tally.failed else 0

    def _tell(self, tally: SyncTally, seconds: float, stopped: str) -> None:
        if self.json:
            said = {
                "sessions": tally.sessions,
                "clips": tally.clips,
                "bytes": tally.bytes,
                "sessions_before": tally.before,
                "damaged": tally.damaged,
                "unfinished": tally.unfinished,
                "without_clips": tally.notes,
                "failed": tally.failed,
                "stopped": stopped or None,
                "seconds": round(seconds, 1),
            }
            print(json.dumps(said, indent=1, ensure_ascii=False))
        for name in tally.unfinished:
            print(
                f"cipv: {one_line(name)}: still being recorded, or cut off (`cipv recover`); not copied",
                file=sys.stderr,
            )
        for name in tally.damaged:
            print(f"cipv: {one_line(name)}: its copy was damaged", file=sys.stderr)
        for name, reason in (*tally.notes.items(), *tally.failed.items()):
            print(f"cipv: {one_line(f'{name}: {reason}')}", file=sys.stderr)
        if stopped:
            print(f"cipv: {stopped}; {_CONTINUES}", file=sys.stderr)
        print(
            f"cipv: {tally.sessions} sessions and {tally.clips} clips sent, {size_text(tally.bytes)} in "
            f"{seconds:.0f} s; {tally.before} sessions sent before",
            file=sys.stderr,
        )
