"""A background job: progress, cancellation, result and error."""

from __future__ import annotations

import pytest

from app.core.jobs import BackgroundJob, JobStatus
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from pipeline.common.progress import Progress


def half(progress: Progress) -> str:
    progress(1, 2)
    return "made"


def test_a_job_goes_from_waiting_to_done_and_tells_each_step():
    told: list[JobStatus] = []
    job = BackgroundJob(half, lambda: told.append(job.status))
    assert (job.status, job.result) == (JobStatus(), None)
    job.run()
    assert told == [JobStatus("running", 1, 2), JobStatus("done", 1, 2)]
    assert (job.result, job.status.fraction, job.status.has_ended) == ("made", 1.0, True)
    assert not job.cancel(), "it has ended"


def test_progress_is_not_told_more_often_than_asked_for_but_the_end_always_is():
    told: list[str] = []

    def work(progress: Progress) -> None:
        for done in range(100):
            progress(done, 100)

    job = BackgroundJob(work, lambda: told.append(job.status.state), tell_every_s=3600.0)
    job.run()
    assert told == ["running", "done"]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (BadInput("the disk is full"), "the disk is full"),
        (Overloaded("s3://a/b: store error"), "s3://a/b: store error"),
        (ValueError("oops\nand more"), "ValueError: oops"),
    ],
    ids=["a person's fault", "a store's", "ours"],
)
def test_what_the_work_raises_becomes_the_error(error: Exception, said: str, caplog: pytest.LogCaptureFixture):
    def fails(progress: Progress) -> None:
        raise error

    job = BackgroundJob(fails)
    job.run()
    assert (job.status.state, job.status.error, job.result) == ("failed", said, None)
    assert bool(caplog.records) is isinstance(error, ValueError), "a traceback is for what we did wrong"


def test_a_cancelled_job_ends_at_its_next_progress_and_has_no_result():
    def work(progress: Progress) -> str:
        progress(0, 2)
        job.cancel()
        progress(1, 2)
        raise AssertionError("it went on")

    job = BackgroundJob(work)
    job.run()
    assert (job.status, job.result) == (JobStatus("cancelled", 0, 2), None)


def test_a_job_cancelled_before_it_begins_never_runs_and_one_cancelled_in_its_last_moment_has_no_result():
    early = BackgroundJob(half)
    assert early.cancel()
    early.run()
    late: BackgroundJob[str] = BackgroundJob(lambda progress: str(late.cancel()))
    late.run()
    assert [each.status.state for each in (early, late)] == ["cancelled", "cancelled"]
    assert (early.result, late.result) == (None, None)


def test_a_superseded_job_is_cancelled():
    job = BackgroundJob(half, is_superseded=lambda: True)
    job.run()
    assert job.status.state == "cancelled"
