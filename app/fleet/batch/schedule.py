"""Runs a batch on Dask: creates tasks, follows up on their results, and counts them. Dask decides where and when each
task runs, and reruns the tasks of a worker that died."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed
from distributed.utils import get_mp_context

from app.core.stop_signals import held_back
from app.fleet.batch import work
from app.fleet.batch.job import Job, Outcome, TooLong
from app.fleet.batch.work import WrongWorker, look_at_piece, run_drive, set_aside
from pipeline.common.errors import BadInput, first_line
from pipeline.common.files.user_files import Overloaded

IN_FLIGHT_A_THREAD = 3
"""Pieces of work submitted to Dask at once, per worker thread: one runs, the others are ready."""
TRIES = 2
"""Number of times that a piece is submitted: if its worker died too often for Dask, it is submitted again before it is
set aside."""
_LOSSES = 3
"""Number of times that a piece that Dask dropped is submitted again."""
CAN_FORK = sys.platform == "linux"
"""macOS's own libraries do not survive a fork."""
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 5,
    # the same number of threads as in `cipv run`: another order of summation would give other bytes
    "distributed.nanny.pre-spawn-environ": {"MALLOC_TRIM_THRESHOLD_": 65536},
    "distributed.scheduler.worker-saturation": 1.0,
    # Dask samples the stacks of its workers and keeps an hour of them: 0.2 MB a second, 0.7 GB
    "distributed.worker.profile.enabled": False,
    "distributed.comm.timeouts.connect": "60s",
    "distributed.scheduler.work-stealing": True,
    "distributed.admin.large-graph-warning-threshold": "100MB",
    # workers are forked from a process that has imported what they need, which takes each of them seconds
    "distributed.worker.multiprocessing-method": "forkserver" if CAN_FORK else "spawn",
}


class SchedulerLost(Exception):
    """The connection to the scheduler is lost; finished drives are kept."""


@dataclass
class Tally:
    """The state of a batch so far."""

    total: int
    """Drives of the batch."""
    before: int = 0
    """Drives finished by an earlier run of the batch."""
    done: int = 0
    """Drives finished in this run."""
    frames: int = 0
    """Number of their frames."""
    looked_at: int = 0
    """Number of images processed by networks."""
    aside: dict[str, str] = field(default_factory=dict)
    """Address → reason, of recordings set aside permanently: retried only if they change."""
    failed: dict[str, str] = field(default_factory=dict)
    """Address → reason, of drives that failed for a temporary reason: retried by the next batch."""

    @property
    def left(self) -> int:
        """Drives without an outcome yet."""
        return self.total - self.before - self.done - len(self.aside) - len(self.failed)


def usual_workers() -> int:
    """Default number of processes on this machine: half its cores, since each runs networks on two threads."""
    return max(1, (os.cpu_count() or 1) // 2)


@contextmanager
def client_of(scheduler: str | None, workers: int, memory: str) -> Iterator[Client]:
    """A client of Dask: of a running scheduler, or of a cluster in processes of this machine, that ends with it.

    Args:
        scheduler: its address; None: a cluster of this machine.
        workers: how many processes that has.
        memory: limit of each, e.g. ``"1.5GB"``; a worker that exceeds it is restarted.

    Raises:
        BadInput: the scheduler cannot be reached.
    """
    with dask.config.set(_SETTINGS), _quiet():
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=30)
            except (OSError, ValueError, TimeoutError) as error:
                raise BadInput(f"--scheduler {scheduler}: cannot reach a Dask scheduler: {first_line(error)}") from None
            with client:
                yield client
            return
        with ExitStack() as running:
            with held_back():  # Dask cannot close a cluster that has not started
                _import_for_workers()
                cluster = running.enter_context(
                    LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        memory_limit=memory,
                        host="127.0.0.1",
                        dashboard_address="127.0.0.1:0",
                        silence_logs=50,
                        security=True,  # other users of this machine cannot send it work
                        env=dict(os.environ),  # a forked worker has the environment of the first one
                    )
                )
            yield running.enter_context(Client(cluster))


def _import_for_workers() -> None:
    """Name the modules that workers are forked with, where they are forked. None of them starts threads that a worker
    uses: networks are opened and kernels compiled in the worker."""
    if CAN_FORK:
        get_mp_context().set_forkserver_preload(["distributed", work.__name__])


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppresses Dask's own messages: tracebacks of closed connections, which are reported here in one line."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed")
        try:
            for name in names:
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)
            yield
        finally:
            for name, level in levels.items():
                logging.getLogger(name).setLevel(level)


def run_batch(client: Client, jobs: Sequence[Job], tally: Tally, told: Callable[[Tally], object]) -> None:
    """Run every job.

    Args:
        client: of Dask.
        jobs: drives that are not done.
        tally: changed as drives end.
        told: called after each change of it.

    Raises:
        SchedulerLost: the connection to Dask is lost; finished drives are kept.
        WrongWorker: the workers run other code or have other networks.
    """
    _Batch(client, jobs, tally, told).run()


@dataclass
class _Piece:
    """One piece of work at Dask's: a whole drive, or (first is not None) images of one."""

    job: Job
    first: int | None = None
    is_last_look: bool = False
    """For a whole drive: whether its images have been processed."""
    tries: int = 1
    losses: int = 0
    """How often Dask dropped it without a result."""


class _Batch:
    def __init__(self, client: Client, jobs: Sequence[Job], tally: Tally, told: Callable[[Tally], object]) -> None:
        self._client, self._tally, self._told = client, tally, told
        self._waiting = deque(_Piece(job) for job in jobs)
        self._at_work: dict[str, _Piece] = {}
        self._looks_left: dict[str, int] = {}
        """Number of unprocessed pieces of long recordings, by drive."""

    def run(self) -> None:
        results = as_completed([], with_results=False, raise_errors=False)
        try:
            while self._waiting or self._at_work:
                self._hand_over(results)
                future = next(results)
                piece = self._at_work.pop(str(future.key))
                self._take(piece, future)
                future.release()
                self._told(self._tally)
        except (OSError, TimeoutError, StopIteration, RuntimeError) as error:
            raise SchedulerLost(first_line(error)) from error

    def _hand_over(self, results: as_completed) -> None:
        """Submit enough pieces to Dask to keep its workers busy."""
        threads = max(1, sum(self._client.nthreads().values()))
        while self._waiting and len(self._at_work) < IN_FLIGHT_A_THREAD * threads:
            piece = self._waiting.popleft()
            key = _key(piece)
            future = self._client.submit(*_call(piece), key=key, pure=False, retries=0)
            self._at_work[key] = piece
            results.add(future)

    def _take(self, piece: _Piece, future: Any) -> None:
        """Handle a finished piece."""
        if future.status == "finished":
            self._finished(piece, future.result())
            return
        if future.status in ("lost", "cancelled"):
            # workers that die one after the other can make Dask drop a task; without a scheduler, it drops all
            if self._client.status != "running" or piece.losses == _LOSSES:
                raise SchedulerLost("the scheduler lost the task")
            self._waiting.append(replace(piece, losses=piece.losses + 1))
            return
        error = future.exception()
        if isinstance(error, WrongWorker):
            raise error
        if isinstance(error, KilledWorker) and piece.tries < TRIES:
            self._waiting.append(replace(piece, tries=piece.tries + 1))
        elif isinstance(error, KilledWorker):
            self._set_aside(piece, "every worker that opened it died: out of memory, or a crash")
        elif isinstance(error, BadInput):
            self._set_aside(piece, str(error))
        else:
            what = str(error) if isinstance(error, Overloaded) else f"{type(error).__name__}: {first_line(error)}"
            self._fail(piece, what)

    def _finished(self, piece: _Piece, result: Outcome | TooLong | int) -> None:
        tally, drive = self._tally, piece.job.recording.drive
        if isinstance(result, TooLong):
            self._looks_left[drive] = len(result.pieces)
            self._waiting.extendleft(_Piece(piece.job, first) for first in reversed(result.pieces))
        elif isinstance(result, Outcome):
            tally.looked_at += result.looked_at
            if result.reason:
                tally.aside[piece.job.recording.address] = result.reason
            else:
                tally.done, tally.frames = tally.done + 1, tally.frames + result.frames
        else:
            tally.looked_at += result
            self._one_look_less(piece)

    def _one_look_less(self, piece: _Piece) -> None:
        """After the last piece, the drive itself is submitted."""
        drive = piece.job.recording.drive
        if drive not in self._looks_left:
            return  # another piece has failed
        self._looks_left[drive] -= 1
        if not self._looks_left[drive]:
            del self._looks_left[drive]
            self._waiting.appendleft(_Piece(piece.job, is_last_look=True))

    def _set_aside(self, piece: _Piece, reason: str) -> None:
        if self._gives_up(piece):
            self._tally.aside[piece.job.recording.address] = set_aside(piece.job, reason).reason

    def _fail(self, piece: _Piece, reason: str) -> None:
        if self._gives_up(piece):
            self._tally.failed[piece.job.recording.address] = piece.job.reason(reason)

    def _gives_up(self, piece: _Piece) -> bool:
        """Whether a drive is set aside now; false if it already was because of another piece."""
        drive = piece.job.recording.drive
        return piece.first is None or self._looks_left.pop(drive, None) is not None


def _call(piece: _Piece) -> tuple[Any, ...]:
    if piece.first is not None:
        return look_at_piece, piece.job, piece.first
    return run_drive, piece.job, not piece.is_last_look


def _key(piece: _Piece) -> str:
    """Its name at Dask's, and on Dask's page."""
    what = "run" if piece.first is None else f"look-{piece.first}"
    last = "-whole" if piece.is_last_look else ""
    return f"{what}{last}-{piece.job.recording.drive}-{piece.job.key.name}-{piece.tries + piece.losses}"
