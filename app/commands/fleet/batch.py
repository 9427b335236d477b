"""`cipv batch`: run the pipeline on every recording of a fleet."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from app.commands.support.cluster import ClusterOptions, run_with_bar, tally_of
from app.commands.support.interruption import says_when_interrupted
from app.commands.support.options import PipelineOptions
from app.commands.support.progress_bars import share_progress, task_progress
from app.core.terminal import one_line
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput

if TYPE_CHECKING:
    from app.fleet.batch.plan import Plan
    from app.fleet.batch.schedule import Tally

_MOST_REASONS = 20


@dataclass(frozen=True)
class Batch:
    """Run the pipeline on many recordings, in as many processes as this machine or a Dask cluster has, and write the
    results as tables. Work that an earlier batch in the same folder did with the same code, parameters and networks is
    not repeated.

    Example: cipv batch s3://fleet/2026/*.mcap --out drives --workers 8
    """

    addresses: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")] = ()
    """Recordings: sources as for `cipv run`, folders, globs, s3://, gs://, az:// and http:// addresses of sessions or
    of folders with sessions, and list files (.txt, one address per line)"""
    out: Annotated[str, tyro.conf.arg(metavar="DIR")] = ""
    """Output folder for the tables, or an address in a store"""
    resume: bool = False
    """Continue the batch in that folder, with the recordings and options it was started with"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the cars had this sensor only"""
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    results: bool = False
    """Also write the results as JSON lines without timings, compressed with zstd, for `cipv evaluate --results`"""
    cluster: ClusterOptions = field(default_factory=ClusterOptions)
    json: bool = False
    """Print what was done as JSON"""

    def __call__(self) -> int:
        need_extra()
        from app.fleet.batch.plan import Plan, begin, work_of
        from app.fleet.batch.schedule import SchedulerLost
        from app.fleet.pack import pack
        from app.fleet.store import Store

        self._check()
        store = Store(self.out)
        plan = Plan.load(store) if self.resume else self._plan()
        work = work_of(plan, store)
        how = f"`cipv batch --resume --out {self.out}` continues"
        with store.alone():
            begin(plan, work, store)
            tally = tally_of(work)
            start = time.monotonic()
            if work.jobs:
                try:
                    with says_when_interrupted(how), self.cluster.client(len(work.jobs)) as client:
                        run_with_bar(client, work, tally)
                except SchedulerLost as lost:
                    print(f"cipv: connection to Dask lost: {lost}; {how}", file=sys.stderr)
                    return 1
            with says_when_interrupted(how), share_progress() as bar:
                pack(store, work.key.name, task_progress(bar, "packing the tables"))
        self._tell(work.key.name, tally, time.monotonic() - start)
        return 1 if tally.failed else 0

    def _check(self) -> None:
        if not self.out:
            raise BadInput("--out DIR: give a folder for the tables")
        if bool(self.addresses) == self.resume:
            raise BadInput("give recordings, or --resume to continue the batch in that folder; not both")
        if self.resume and self.pipeline.changes_parameters():
            raise BadInput("--resume uses the parameters that the batch was started with; remove them")
        self.cluster.check()

    def _plan(self) -> Plan:
        from app.fleet.batch.addresses import absolute
        from app.fleet.batch.plan import Plan

        params, choice = self.pipeline.parameters(), self.pipeline.choice()
        return Plan(tuple(map(absolute, self.addresses)), params, choice, self.sensors, self.rings, self.results)

    def _tell(self, run: str, tally: Tally, seconds: float) -> None:
        said = {
            "run": run,
            "drives": tally.total,
            "done_before": tally.before,
            "done": tally.done,
            "frames": tally.frames,
            "images_looked_at": tally.looked_at,
            "seconds": round(seconds, 1),
            "aside": tally.aside,
            "failed": tally.failed,
        }
        if self.json:
            print(json.dumps(said, indent=1, ensure_ascii=False))
        for word, found in (("set aside", tally.aside), ("failed, will be retried", tally.failed)):
            for address, reason in list(found.items())[:_MOST_REASONS]:
                print(f"cipv: {word}: {one_line(f'{address}: {reason}')}", file=sys.stderr)
            if len(found) > _MOST_REASONS:
                print(f"cipv: {word}: {len(found) - _MOST_REASONS} more, see aside/run={run}", file=sys.stderr)
        print(
            f"cipv: run {run}: {tally.done} drives done, {tally.before} already done, {len(tally.aside)} set aside, "
            f"{len(tally.failed)} failed; {tally.frames} frames in {seconds:.0f} s",
            file=sys.stderr,
        )
