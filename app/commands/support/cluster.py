"""Options of commands that run many drives, and running these with a progress bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from app.commands.support.arguments import option
from app.commands.support.progress_bars import drives_progress
from pipeline.common.errors import BadInput

if TYPE_CHECKING:
    from distributed import Client

    from app.fleet.batch.plan import PlannedWork
    from app.fleet.batch.schedule import Tally


LEAST_MEMORY_MB = 500
"""Of one process. With its libraries, it takes 260 MB, and networks come on top; Dask restarts it at 95 % of its limit
before it could say so, again and again."""


@dataclass(frozen=True)
class ClusterOptions:
    """Where drives are run."""

    workers: Annotated[int | None, option("N")] = None
    """Processes on this machine. Default: half its cores, since each runs networks on two threads"""
    memory: Annotated[str, tyro.conf.arg(metavar="SIZE")] = "3GB"
    """Memory limit of each process; one that exceeds it is restarted"""
    scheduler: Annotated[str | None, option("ADDRESS")] = None
    """A running Dask scheduler, e.g. tcp://10.0.0.5:8786, whose workers have the same version installed"""

    def check(self) -> None:
        """BadInput if an option has an impossible value."""
        if self.workers is not None and self.workers < 1:
            raise BadInput(f"--workers {self.workers}: expected at least 1")
        from dask.utils import parse_bytes

        try:
            memory_bytes = parse_bytes(self.memory)
        except ValueError:
            raise BadInput(f"--memory {self.memory}: expected a size such as 3GB") from None
        if memory_bytes < LEAST_MEMORY_MB * 1e6:
            raise BadInput(f"--memory {self.memory}: expected at least {LEAST_MEMORY_MB}MB")

    @contextmanager
    def client(self, drives: int) -> Iterator[Client]:
        """A Dask client with workers for ``drives`` drives. Prints the address of Dask's dashboard. BadInput if the
        scheduler does not answer."""
        from app.fleet.batch.schedule import client_of, usual_workers

        count = max(1, min(self.workers or usual_workers(), drives)) if self.scheduler is None else 0
        with client_of(self.scheduler, count, self.memory) as client:
            print(f"cipv: Dask dashboard: {client.dashboard_link}", file=sys.stderr)
            yield client


def run_with_bar(client: Client, work: PlannedWork, tally: Tally, title: str = "drives") -> None:
    """Run the remaining drives of a batch with a progress bar. Raises what ``run_batch`` raises."""
    from app.fleet.batch.schedule import run_batch

    with drives_progress() as bar:
        task = bar.add_task(title, total=tally.total, completed=tally.total - tally.left, rate="")
        start = time.monotonic()

        def told(now: Tally) -> None:
            rate = now.frames / max(time.monotonic() - start, 1e-3)
            bar.update(task, completed=now.total - now.left, rate=f"{rate:.1f} frames/s")

        run_batch(client, work.jobs, tally, told)


def tally_of(work: PlannedWork) -> Tally:
    """The tally of drives that an earlier batch has already done."""
    from app.fleet.batch.schedule import Tally
    from app.fleet.runs import set_aside

    wanted = {recording.address for recording in work.all}
    aside = {name: why for name, why in set_aside(work.store, work.key.name).items() if name in wanted}
    return Tally(len(work.all), work.done_before - len(aside), aside=aside)
