"""Proof of batches at scale: makes a fleet, runs it from an S3 on this machine, and compares bytes, times and memory.

    python -m tests.soak.fleet --sessions 2000 --seconds 1 --folder /tmp/fleet --report build/fleet.json

One worker, then two that are killed ten times, on a store that fails every twentieth request, with a scheduler that is
killed and a batch that is resumed; and one worker against two, undisturbed, on ``--timed`` of the sessions. Sessions
that are in the folder already are used again.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fsspec
import psutil

from app.bench.fleet_sessions import make_sessions
from app.core.server_address import listen_socket
from app.fleet.batch.schedule import SchedulerLost, Tally, client_of, run_batch
from pipeline.common.files.data_dir import data_dir
from pipeline.recording.save import save
from pipeline.sources import open_source
from tests.app.fleet.fleets import begun, contents, plan_of
from tests.conftest import ROOT
from tests.soak.fleet.store import BUCKET, ENVIRONMENT, s3_process

REAL_FRAMES, REAL_STEP = 12, 3
REAL = {
    "astyx": "astyx:{}/astyx",
    "astyx-more": "astyx:{}/astyx_more",
    "kitti": "kitti:{}/kitti_0052",
    "kitti-0009": "kitti:{}/kitti_0009/2011_09_26/2011_09_26_drive_0009_sync",
}
KILLS, FAILING, MEMORY = 10, 20, "3GB"
ALL, SOME = "all", "some"
"""Folders of the store: every session, and those on which one worker is timed against two."""


def make_fleet(folder: Path, count: int, seconds: float) -> list[Path]:
    """So many sessions: parts of the real recordings of ``CIPV_DATA``, at most a quarter, and so many seconds each of
    simulated traffic."""
    folder.mkdir(parents=True, exist_ok=True)
    real = [file for _, file in zip(range(count // 4), _real(folder), strict=False)]
    return [*make_sessions(folder, count - len(real), seconds), *real]


def _real(folder: Path) -> Iterator[Path]:
    for name, address in REAL.items():
        uri = address.format(data_dir())
        if not Path(uri.partition(":")[2]).is_dir():
            continue
        source = open_source(uri)
        for first in range(0, len(source) - REAL_FRAMES + 1, REAL_STEP):
            file = folder / f"real-{name}-{first:04d}.mcap"
            if not file.exists():
                save(source, file, first, first + REAL_FRAMES - 1)
            yield file


class Cluster:
    """A scheduler and workers, which are restarted when they die, in processes that can be killed."""

    def __init__(self, workers: int) -> None:
        with listen_socket("127.0.0.1", 0, strict=True) as free:
            port = str(free.getsockname()[1])
        self.address = f"tcp://127.0.0.1:{port}"
        dask = [sys.executable, "-m", "dask"]
        how: dict[str, Any] = {
            "cwd": ROOT,
            "stderr": subprocess.DEVNULL,
            "env": os.environ | {"PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "5"},
        }
        at = ["--host", "127.0.0.1", "--port", port, "--no-dashboard"]
        self.scheduler = subprocess.Popen([*dask, "scheduler", *at], **how)
        options = ["--nworkers", str(workers), "--nthreads", "1", "--no-dashboard", "--memory-limit", MEMORY]
        self._workers = subprocess.Popen([*dask, "worker", self.address, *options, "--death-timeout", "600"], **how)

    def stop(self) -> None:
        for process in (self._workers, self.scheduler):
            children = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
            for each in (process, *children):
                each.kill()
            process.wait()


@contextmanager
def cluster(workers: int) -> Iterator[Cluster]:
    """A ``Cluster`` that ends with the block."""
    running = Cluster(workers)
    try:
        yield running
    finally:
        running.stop()


def plain(inside: str, workers: int) -> tuple[dict[str, str], dict[str, Any]]:
    """A batch without faults: (the digests of its files, its figures)."""
    out = f"s3://{BUCKET}/out-{inside}-{workers}"
    work = begun(plan_of(f"s3://{BUCKET}/{inside}", results=True), out)
    tally, memory = Tally(len(work.all)), []
    start = time.monotonic()
    with client_of(None, workers, MEMORY) as client:

        def told(now: Tally) -> None:
            memory.append(max(client.run(resident_bytes).values()))

        run_batch(client, work.jobs, tally, told)
        wall_s = time.monotonic() - start
    most = [round(max(part) / 1e6) for part in (memory[:10], memory[-10:], memory)]
    figures = {"workers": workers, "wall_s": round(wall_s, 1), "drives": tally.done, "frames": tally.frames}
    figures |= {"aside": len(tally.aside), "failed": tally.failed, "images_looked_at": tally.looked_at}
    return contents(out), figures | {"mb_first_10_last_10_most": most, "load_average": os.getloadavg()[1]}


def resident_bytes() -> int:
    """Memory of this process."""
    return int(psutil.Process().memory_info().rss)


def faulty(endpoint: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Run a batch with all faults. Returns the digests of its files, and its figures."""
    out = f"s3://{BUCKET}/out-faulty"
    every(endpoint, FAILING)
    killed, schedulers, start = set[int](), 0, time.monotonic()
    plan = plan_of(f"s3://{BUCKET}/{ALL}", results=True)
    work = begun(plan, out)
    count, left, tally = len(work.all), len(work.jobs), Tally(len(work.all))
    while left:
        with cluster(2) as running, client_of(running.address, 0, MEMORY) as client:

            def told(
                now: Tally, running: Cluster = running, client: Any = client, alive: bool = not schedulers
            ) -> None:
                done = count - now.left
                if alive and done > count // 3:
                    running.scheduler.send_signal(signal.SIGKILL)
                elif len(killed) < KILLS * done / count:
                    pids = client.run(os.getpid, on_error="ignore").values()
                    for pid in [each for each in pids if isinstance(each, int) and each not in killed][:1]:
                        killed.add(pid)
                        os.kill(pid, signal.SIGKILL)

            client.wait_for_workers(1)
            try:
                run_batch(client, work.jobs, tally, told)
            except SchedulerLost:
                schedulers += 1
        work = begun(plan, out)
        left = len(work.jobs)
        tally = Tally(count, count - left)
    wall_s = time.monotonic() - start
    requests, failed = every(endpoint, 0)
    figures = {"workers_killed": len(killed), "schedulers_killed": schedulers, "wall_s": round(wall_s, 1)}
    return contents(out), figures | {"requests": requests, "requests_failed": failed}


def every(endpoint: str, number: int) -> tuple[int, int]:
    """Let every n-th request fail from now on; 0 for none. Returns the number of requests so far, and of failed
    ones."""
    for _ in range(3):  # this request may itself fail
        try:
            with urllib.request.urlopen(f"{endpoint}/every/{number}") as answer:
                requests, failed = answer.read().split()
                return int(requests), int(failed)
        except OSError:
            continue
    raise RuntimeError("the store does not answer")


def main() -> int:
    """Exit status: 0 if all batches gave the same bytes."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=5.0, help="length of a simulated session")
    parser.add_argument("--timed", type=int, default=200, help="sessions on which one worker is timed against two")
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--report", type=Path, default=ROOT / "build" / "fleet.json")
    asked = parser.parse_args()
    files = make_fleet(asked.folder, asked.sessions, asked.seconds)
    report: dict[str, Any] = {
        "sessions": len(files),
        "real": sum(file.name.startswith("real-") for file in files),
        "bytes": sum(file.stat().st_size for file in files),
        "cores": os.cpu_count(),
    }
    with s3_process(0) as endpoint:
        os.environ |= ENVIRONMENT | {"AWS_ENDPOINT_URL": endpoint}
        system = fsspec.filesystem("s3", skip_instance_cache=True)
        system.mkdir(BUCKET)
        for file in files:
            system.put_file(str(file), f"{BUCKET}/{ALL}/{file.name}")
        for file in files[:: max(1, len(files) // asked.timed)]:
            system.put_file(str(file), f"{BUCKET}/{SOME}/{file.name}")
        one, report["one_of_some"] = plain(SOME, 1)
        two, report["two_of_some"] = plain(SOME, 2)
        report["two_equal_bytes"] = two == one
        report["ratio"] = round(report["one_of_some"]["wall_s"] / report["two_of_some"]["wall_s"], 2)
        _say(asked.report, report)
        expected, report["one"] = plain(ALL, 1)
        _say(asked.report, report)
        found, report["faulty"] = faulty(endpoint)
        report["faulty_equal_bytes"] = found == expected
        report["files_compared"] = len(expected)
        _say(asked.report, report)
    return 0 if report["two_equal_bytes"] and report["faulty_equal_bytes"] else 1


def _say(file: Path, report: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report), flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
