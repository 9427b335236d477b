"""Times a batch with one worker against two, from an S3 on this machine, and says what else the machine did meanwhile.

    python -m tests.soak.fleet.ratio --folder DIR --sessions 60 --tries 3

DIR holds sessions of ``tests.soak.fleet``. One and two workers take turns. Of a machine with two cores, workers, store,
scheduler and this process use all, so a ratio holds only if other programs used little: ``other_cores`` says how much.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from time import perf_counter
from typing import Any

import fsspec
import psutil

from app.fleet.batch.schedule import Tally, client_of, run_batch
from tests.app.fleet.fleets import begun, contents, plan_of
from tests.soak.fleet.store import BUCKET, ENVIRONMENT, s3_process

SOME, FEW, MEMORY = "some", "few", "3GB"
WARM = 10
"""Sessions that compile the kernels before the first time is taken."""


def cpu_s() -> tuple[float, float]:
    """Seconds of processor time so far: of the whole machine, and of this process and its children that live."""
    every = psutil.cpu_times()
    me = psutil.Process()
    own = 0.0
    for each in (me, *me.children(recursive=True)):
        try:
            own += sum(each.cpu_times()[:2])
        except psutil.NoSuchProcess:
            continue
    return sum(every) - every.idle - every.iowait - every.steal, own


def timed(workers: int, attempt: int, folder: str = SOME) -> tuple[dict[str, str], dict[str, Any]]:
    """One batch over a folder of the bucket: (the digests of its files, its figures)."""
    out = f"s3://{BUCKET}/out-{folder}-{workers}-{attempt}"
    work = begun(plan_of(f"s3://{BUCKET}/{folder}"), out)
    tally = Tally(len(work.all))
    start = perf_counter()
    with client_of(None, workers, MEMORY) as client:
        begin, before = perf_counter(), cpu_s()
        run_batch(client, work.jobs, tally, lambda _: None)
        end, after = perf_counter(), cpu_s()
    machine, own = (late - early for late, early in zip(after, before, strict=True))
    return contents(out), {
        "workers": workers,
        "drives": tally.done,
        "frames": tally.frames,
        "start_s": round(begin - start, 1),
        "run_s": round(end - begin, 1),
        "own_cores": round(own / (end - begin), 2),
        "other_cores": round(max(0.0, machine - own) / (end - begin), 2),
    }


def main() -> int:
    """Exit status: 0 if every batch gave the same bytes."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--sessions", type=int, default=60)
    parser.add_argument("--tries", type=int, default=3)
    asked = parser.parse_args()
    files = sorted(asked.folder.glob("*.mcap"))
    is_same = True
    with s3_process(0) as endpoint:
        os.environ |= ENVIRONMENT | {"AWS_ENDPOINT_URL": endpoint}
        system = fsspec.filesystem("s3", skip_instance_cache=True)
        system.mkdir(BUCKET)
        for file in files[:: max(1, len(files) // asked.sessions)]:
            system.put_file(str(file), f"{BUCKET}/{SOME}/{file.name}")
        for file in files[:WARM]:
            system.put_file(str(file), f"{BUCKET}/{FEW}/{file.name}")
        timed(1, 0, FEW)
        for attempt in range(asked.tries):
            (one, first), (two, second) = timed(1, attempt), timed(2, attempt)
            is_same = is_same and one == two
            ratio = round(first["run_s"] / second["run_s"], 2)
            print(json.dumps({"ratio": ratio, "same_bytes": one == two, "one": first, "two": second}), flush=True)
    return 0 if is_same else 1


if __name__ == "__main__":
    raise SystemExit(main())
