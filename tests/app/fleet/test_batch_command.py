"""`cipv batch`, as it is typed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.cli import main
from app.commands.support.cluster import ClusterOptions
from app.fleet import extra
from app.fleet.batch.work import run_drive
from app.fleet.store import Store
from tests.app.fleet.fleets import COPIES, LENGTH, SESSIONS, begun, contents, plan_of
from tests.app.waiting import wait_until
from tests.conftest import ROOT

LIDAR = ("--sensors", "lidar", "--lanes", "off", "--far-view-px", "0", "--results")
CIPV = [sys.executable, "-c", "from app.cli import main; main()"]


def cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


@contextmanager
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """The address of a Dask scheduler with a worker, and both processes."""
    said = {"stderr": subprocess.PIPE, "text": True, "cwd": ROOT, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    dask = [sys.executable, "-m", "dask"]
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"],
        **said,  # type: ignore[call-overload]
    )
    started = [scheduler]
    try:
        address = ""
        while not address:
            line = scheduler.stderr.readline()
            assert line, "the scheduler ended"
            match = re.search(r"tcp://127\.0\.0\.1:\d+", line)
            address = match[0] if match else ""
        # it may take as long as it likes to start, and is killed below
        options = ["--nthreads", "1", "--no-dashboard", "--no-nanny"]
        worker = subprocess.Popen(
            [*dask, "worker", address, *options],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stderr=subprocess.DEVNULL,
            text=True,
        )
        started.append(worker)
        yield address, started
    finally:
        for process in started:
            process.kill()
            process.wait()
        scheduler.stderr.close()


def test_a_scheduler_that_is_killed_and_the_batch_resumed(fleet: Path, tmp_path: Path):
    """Some drives are done when the scheduler ends; a new scheduler gets the rest."""
    out, expected = tmp_path / "out", tmp_path / "expected"
    for job in begun(plan_of(fleet, sensors="lidar", results=True), expected).jobs:
        run_drive(job)
    with cluster() as (address, (scheduler, _)):
        typed = [*CIPV, "batch", str(fleet), "--out", str(out), "--scheduler", address, *LIDAR]
        with subprocess.Popen(typed, cwd=ROOT, stderr=subprocess.PIPE, text=True) as batch:
            assert batch.stderr is not None
            assert "Dask dashboard" in batch.stderr.readline()
            assert wait_until(lambda: any(out.glob("done/*/*.json")) or batch.poll() is not None)
            scheduler.send_signal(signal.SIGKILL)
            said = batch.stderr.read()
        assert batch.returncode == 1, said
        assert said.count("\n") == 1, said
        assert "--resume" in said
    done = len(list(out.glob("done/*/*.json")))
    assert 0 < done <= SESSIONS
    with cluster() as (address, _):
        assert cipv("batch", "--resume", "--out", out, "--scheduler", address) == 0
    assert (
        contents(out).keys() - {name for name in contents(out) if name.startswith("packed/")}
        == contents(expected).keys()
    )
    ours = contents(out)
    assert {name: ours[name] for name in contents(expected)} == contents(expected)


def test_a_batch_and_a_second_one_that_has_nothing_to_do(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    some = [str(fleet / "near-0.mcap"), str(fleet / "far-*.mcap")]
    listed = tmp_path / "drives.txt"
    listed.write_text("# some drives\n" + "\n".join(some) + "\n", encoding="utf-8")
    typed = ("batch", listed, "--out", tmp_path / "out", "--workers", 2, *LIDAR, "--json")
    assert cipv(*typed) == 0
    first = json.loads(capsys.readouterr().out)
    drives = 1 + COPIES
    said = (first["drives"], first["done"], first["done_before"], first["frames"])
    assert said == (drives, drives, 0, drives * LENGTH)
    assert cipv(*typed) == 0
    second = json.loads(capsys.readouterr().out)
    assert (second["run"], second["done"], second["done_before"]) == (first["run"], 0, drives)
    assert cipv("batch", "--resume", "--out", tmp_path / "out", "--json") == 0
    assert json.loads(capsys.readouterr().out)["run"] == first["run"]


def test_an_interrupted_batch_says_how_it_is_continued(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    @contextmanager
    def interrupted(*_: object) -> Iterator[None]:
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(ClusterOptions, "client", interrupted)
    assert cipv("batch", fleet / "near-0.mcap", "--out", tmp_path / "out", *LIDAR) == 130
    assert capsys.readouterr().err == f"cipv: interrupted; `cipv batch --resume --out {tmp_path / 'out'}` continues\n"
    assert cipv("sweep", fleet / "near-0.mcap", "--out", tmp_path / "b", "--over", "cluster.min_points=4,5") == 130
    assert capsys.readouterr().err == "cipv: interrupted; run the same command again to continue\n"


WRONG = {
    "no folder": ("batch", "sim:straight"),
    "no recordings": ("batch", "--out", "x"),
    "both": ("batch", "sim:straight", "--resume", "--out", "x"),
    "nothing there": ("batch", "no/such/folder", "--out", "x"),
    "no session in it": ("batch", "app", "--out", "x"),
    "live sensors": ("batch", "live:car.yaml", "--out", "x"),
    "no batch to resume": ("batch", "--resume", "--out", "docs"),
    "no workers": ("batch", "sim:straight", "--out", "x", "--workers", "0"),
    "memory that is no size": ("batch", "sim:straight", "--out", "x", "--memory", "lots"),
    "memory that no worker starts in": ("batch", "sim:straight", "--out", "x", "--memory", "10MB"),
    "a store nobody knows": ("batch", "nowhere://bucket", "--out", "x"),
}


@pytest.mark.parametrize("arguments", WRONG.values(), ids=WRONG)
def test_bad_input_is_said_in_one_line(
    arguments: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    assert cipv(*(str(tmp_path / each) if each == "x" else each for each in arguments)) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("cipv: ")
    assert list(tmp_path.iterdir()) == []


def test_a_second_batch_in_a_folder_is_refused_while_the_first_one_runs(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    typed = ("batch", fleet / "near-0.mcap", "--out", tmp_path / "out", *LIDAR)
    with Store(str(tmp_path / "out")).alone():
        assert cipv(*typed) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "another batch" in said
    assert contents(tmp_path / "out") == {}
    with Store(str(tmp_path / "out")).alone():
        pass  # the first one has ended


def test_without_the_extra_one_line_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(extra, "PACKAGES", ("no_such_package_of_dask",))
    assert cipv("batch", "sim:straight", "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err.strip()
    assert said == "cipv: no_such_package_of_dask not installed; `make install` installs the extra `fleet`"


def test_commands_start_without_the_extra():
    """A process that cannot import any of it parses and runs the other commands."""
    code = (
        "import sys\n"
        f"for name in {extra.PACKAGES!r}: sys.modules[name] = None\n"
        "from app.cli import main\n"
        "main(['run', 'sim:straight', '--frames', '1', '--sensors', 'lidar', '--out', '-'])\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith('{"version"')
