"""`cipv mine`: find the seconds of a fleet that are worth labeling next."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from app.commands.evaluate import DASHBOARD, dashboard_link
from app.commands.labels.files import Database, Person, account
from app.commands.support.arguments import option
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput

if TYPE_CHECKING:
    from app.fleet.mining.choose import ChosenSecond

_PIPED_WIDTH = 200


@dataclass(frozen=True)
class Mine:
    """Find the seconds of a fleet that are worth labeling next: camera and LiDAR disagree, an object is close to the
    edge of the path, the lead contradicts neighbouring frames, or the scene is unlike all other drives.

    Example: cipv mine --out drives --queue
    """

    out: Annotated[str, tyro.conf.arg(metavar="DIR")]
    """The folder of the batch, or its address in a store"""
    count: int = 50
    """Find at most this many seconds"""
    per_drive: int = 5
    """Find at most this many in one drive"""
    queue: bool = False
    """Put them into the labeling queue; seconds that are labelled or queued already are left out"""
    run: Annotated[str | None, option("NAME")] = None
    """The run to search; default: that of the last batch"""
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    person: Person = field(default_factory=account)
    """Author of the change, who can undo it in the dashboard"""
    dashboard: Annotated[str, tyro.conf.arg(metavar="URL")] = DASHBOARD
    """Dashboard address for the links, as `cipv serve` prints it"""
    json: bool = False
    """Print as JSON"""

    def __call__(self) -> int:
        need_extra()
        for name, value in (("--count", self.count), ("--per-drive", self.per_drive)):
            if not 1 <= value <= 100_000:
                raise BadInput(f"{name} {value}: expected 1 to 100000")
        from app.fleet.find import FleetTables
        from app.fleet.mining.choose import choose
        from app.fleet.mining.seconds import seconds_of
        from app.fleet.store import Store

        seconds = seconds_of(FleetTables(Store(self.out), self.run))
        recordings = 0
        if self.queue:
            from app.fleet.mining.queueing import MiningQueue
            from app.labels.store.database import open_database

            database = open_database(self.database)
            try:
                queue = MiningQueue(database)
                chosen = choose(seconds, self.count, self.per_drive, queue.is_known, queue.is_queued)
                recordings = queue.put(chosen, self.person)
            finally:
                database.close()
        else:
            chosen = choose(seconds, self.count, self.per_drive)
        self._print(chosen)
        queued = f"; queued in {recordings} recordings" if self.queue else ""
        print(f"cipv: {len(chosen)} of {len(seconds.second)} seconds{queued}", file=sys.stderr)
        return 0

    def _print(self, chosen: list[ChosenSecond]) -> None:
        rows = [(each, dashboard_link(self.dashboard, each.address, each.first)) for each in chosen]
        if self.json:
            print(json.dumps([asdict(each) | {"text": each.text, "link": link} for each, link in rows], indent=1))
            return
        if not rows:
            return
        table = Table("recording", "second", "frames", "why")
        for each, link in rows:
            name = each.address.rpartition("/")[2].replace("[", r"\[")
            table.add_row(f"[link={link}]{name}[/link]", str(each.second), f"{each.first}–{each.last}", each.text)
        Console(width=None if sys.stdout.isatty() else _PIPED_WIDTH).print(table)
