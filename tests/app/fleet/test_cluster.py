"""Batches on Dask, in processes of their own: the same bytes whatever happens to them."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import dask
import fsspec
import pytest
from distributed import Future

from app.fleet.batch.schedule import Tally, client_of, run_batch
from app.fleet.batch.work import run_drive
from tests.app.fleet.fleets import BAD, SESSIONS, begun, contents, plan_of
from tests.app.fleet.s3 import BUCKET, s3_server

MEMORY, KILLS = "3GB", 3


@pytest.fixture(scope="module")
def expected(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The files of a batch of the fleet, run drive by drive in this process."""
    out = tmp_path_factory.mktemp("expected")
    for job in begun(plan_of(fleet, results=True), out).jobs:
        run_drive(job)
    return contents(out)


def test_two_workers_give_the_bytes_of_none(fleet: Path, tmp_path: Path, expected: dict[str, str]):
    work = begun(plan_of(fleet, results=True), tmp_path)
    tally = Tally(len(work.all))
    said: list[int] = []
    with client_of(None, 2, MEMORY) as client:
        assert client.dashboard_link.startswith("http")
        # an hour of stack samples would take 0.7 GB of each worker
        assert set(client.run(dask.config.get, "distributed.worker.profile.enabled").values()) == {False}
        run_batch(client, work.jobs, tally, lambda now: said.append(now.left))
    assert (tally.done, tally.left, list(tally.failed)) == (SESSIONS, 0, [])
    assert [Path(address).name for address in tally.aside] == [BAD]
    assert said == sorted(said, reverse=True)
    assert contents(tmp_path) == expected
    assert begun(plan_of(fleet, results=True), tmp_path).jobs == ()


def test_tasks_that_dask_drops_are_submitted_again(fleet: Path, tmp_path: Path, expected: dict[str, str]):
    work = begun(plan_of(fleet, results=True), tmp_path)
    tally, dropped = Tally(len(work.all)), list[str]()

    def drop(_: Tally) -> None:
        if not dropped:
            dropped.extend(str(key) for key in client.futures)
            client.cancel([Future(key, client=client) for key in dropped])

    with client_of(None, 1, MEMORY) as client:
        run_batch(client, work.jobs, tally, drop)
    assert dropped
    assert (tally.done, tally.failed) == (SESSIONS, {})
    assert contents(tmp_path) == expected


def test_a_store_that_fails_every_twelfth_request_and_workers_that_are_killed_change_nothing(
    fleet: Path, monkeypatch: pytest.MonkeyPatch, expected: dict[str, str]
):
    """Recordings and tables are in S3. Whenever a drive is done, a worker is killed in the middle of another one.
    Drives are named after their addresses, so only contents are compared."""
    killed = set[int]()

    def kill_one(now: Tally) -> None:
        workers = [pid for pid in client.run(os.getpid, on_error="ignore").values() if isinstance(pid, int)]
        if len(killed) < KILLS and workers and now.left:
            killed.add(workers[0])
            os.kill(workers[0], signal.SIGKILL)

    with s3_server(monkeypatch, every=12) as server:
        system = fsspec.filesystem("s3", skip_instance_cache=True)
        system.put(str(fleet), f"{BUCKET}/in", recursive=True)
        work = begun(plan_of(f"s3://{BUCKET}/in", results=True), f"s3://{BUCKET}/out")
        tally = Tally(len(work.all))
        with client_of(None, 2, MEMORY) as client:
            run_batch(client, work.jobs, tally, kill_one)
        assert (tally.done, tally.failed, len(tally.aside)) == (SESSIONS, {}, 1)
        assert server.failed > 10
        assert len(killed) == KILLS
        found = contents(f"s3://{BUCKET}/out")
    for kind in ("frames", "objects", "events", "scores"):
        ours = sorted(sha for name, sha in found.items() if name.startswith(f"tables/{kind}/"))
        assert ours == sorted(sha for name, sha in expected.items() if name.startswith(f"tables/{kind}/"))
        assert len(ours) == SESSIONS
