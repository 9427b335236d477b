"""Exports in the background: progress, cancelling, what fails, and that nothing is left behind."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.clips.export_queue import MOST_EXPORTS, ExportQueue, ExportRefused, ExportStatus
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress

WAIT_S = 180.0


class Ended:
    """Counts jobs that ended; a test can wait for one."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self.count = 0

    def __call__(self) -> None:
        with self._condition:
            self.count += 1
            self._condition.notify_all()

    def wait(self, count: int) -> None:
        with self._condition:
            assert self._condition.wait_for(lambda: self.count >= count, WAIT_S)


@pytest.fixture
def ended() -> Ended:
    return Ended()


@pytest.fixture
def jobs(ended: Ended) -> Iterator[ExportQueue]:
    jobs = ExportQueue(ended)
    yield jobs
    jobs.close()


def writes(path: Path, report: Progress) -> None:
    report(1, 2)
    path.write_bytes(b"done")


class Held:
    """Work that pauses halfway until it is released."""

    def __init__(self) -> None:
        self.began, self.go = threading.Event(), threading.Event()

    def __call__(self, path: Path, report: Progress) -> None:
        path.write_bytes(b"half")
        report(1, 2)
        self.began.set()
        assert self.go.wait(WAIT_S)
        report(2, 2)


def submit(jobs: ExportQueue, work: Callable[[Path, Progress], None]) -> ExportStatus:
    return jobs.submit("csv", 0, 9, "clip.csv", work)


def test_a_job_ends_in_a_file_to_download(jobs: ExportQueue, ended: Ended):
    job = submit(jobs, writes)
    assert (job.file, jobs.get(job.id) is not None) == (None, True)
    ended.wait(1)
    done = jobs.get(job.id)
    assert done == ExportStatus(job.id, "csv", 0, 9, "done", 1.0, "", "clip.csv", 4)
    path = jobs.path(job.id)
    assert path is not None
    assert path.read_bytes() == b"done"
    assert jobs.cancel(job.id), "an ended job is forgotten"
    assert not path.exists()
    assert jobs.get(job.id) is None
    assert not jobs.cancel(job.id)


def test_progress_is_seen_while_it_runs(jobs: ExportQueue, ended: Ended):
    held = Held()
    job = submit(jobs, held)
    assert held.began.wait(WAIT_S)
    running = jobs.get(job.id)
    assert running is not None
    assert (running.state, running.progress, running.file) == ("running", 0.5, None)
    assert jobs.path(job.id) is None
    held.go.set()
    ended.wait(1)


@pytest.mark.parametrize(
    ("error", "note"),
    [(BadInput("the disk is full"), "the disk is full"), (ValueError("oops"), "ValueError: oops")],
    ids=["a person's fault", "ours"],
)
def test_a_failed_job_says_why_and_the_next_goes_on(jobs: ExportQueue, ended: Ended, error: Exception, note: str):
    def fails(path: Path, report: Progress) -> None:
        path.write_bytes(b"half")
        raise error

    failed, next_one = submit(jobs, fails), submit(jobs, writes)
    ended.wait(2)
    found = jobs.get(failed.id)
    assert found is not None
    assert (found.state, found.note, found.file) == ("failed", note, None)
    assert jobs.path(failed.id) is None
    assert not (jobs._folder / failed.id).exists()
    after = jobs.get(next_one.id)
    assert after is not None
    assert after.state == "done"


def test_a_cancelled_job_stops_and_leaves_no_file(jobs: ExportQueue, ended: Ended):
    held, waiting = Held(), Held()
    running, later = submit(jobs, held), submit(jobs, waiting)
    assert held.began.wait(WAIT_S)
    assert jobs.cancel(later.id)
    assert jobs.cancel(running.id)
    held.go.set()
    ended.wait(1)
    assert {job.state for job in jobs.all()} == {"cancelled"}
    assert not waiting.began.is_set()
    assert list(jobs._folder.iterdir()) == []


def test_a_jobs_work_is_let_go_when_it_has_ended_or_was_cancelled(jobs: ExportQueue, ended: Ended):
    """The work holds a whole recording in memory."""
    held, waiting = Held(), Held()
    first, second = submit(jobs, held), submit(jobs, waiting)
    assert held.began.wait(WAIT_S)
    gone = [weakref.ref(held), weakref.ref(waiting)]
    jobs.cancel(second.id)
    del waiting
    gc.collect()
    assert gone[1]() is None
    held.go.set()
    ended.wait(1)
    del held
    assert let_go(gone[0]), first


def let_go(what: weakref.ref[Held]) -> bool:
    """Poll, because the worker's call returns a moment after it reports the end."""
    looking = threading.Event()
    for _ in range(round(WAIT_S / 0.01)):
        gc.collect()
        if what() is None:
            return True
        looking.wait(0.01)
    return False


def test_so_many_jobs_and_no_more(jobs: ExportQueue, ended: Ended):
    held = Held()
    first = submit(jobs, held)
    for _ in range(MOST_EXPORTS - 1):
        submit(jobs, writes)
    with pytest.raises(ExportRefused, match="under way"):
        submit(jobs, writes)
    held.go.set()
    ended.wait(MOST_EXPORTS)
    submit(jobs, writes)
    assert jobs.get(first.id) is None, "the oldest that had ended went"


def test_closing_stops_what_is_under_way_and_removes_every_file():
    jobs, held = ExportQueue(), Held()
    submit(jobs, held)
    assert held.began.wait(WAIT_S)
    folder = jobs._folder
    held.go.set()
    jobs.close()
    assert not folder.exists()
    ExportQueue().close()  # one that never had a job has nothing to remove
