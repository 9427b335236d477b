"""No command, page or viewer calls another machine or looks a name up, or leaves an identity behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.network_watch import cannot_watch, watched

ROOT = Path(__file__).resolve().parents[2]
WAIT_S = 60.0
CIPV = [sys.executable, "-c", "from app.cli import main; main()"]
pytestmark = pytest.mark.skipif(cannot_watch() is not None, reason=cannot_watch() or "")


@pytest.fixture
def at_home(tmp_path: Path) -> dict[str, Any]:
    """How to start a program of a person whose home is empty."""
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / ".cache"), "CIPV_HOME": str(tmp_path / "cipv")}
    return {
        "cwd": ROOT,
        "env": os.environ | {"PYTHONPATH": str(ROOT)} | home,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }


def left_behind(home: Path) -> list[Path]:
    """What looks like telemetry in a home: files with a device's or user's identity, or a queue of events."""
    names = ("deviceid", "onnxruntime.db", "analytics.json")
    return [path for path in home.rglob("*") if path.name in names or "Microsoft" in path.parts]


def test_the_watch_sees_a_lookup_of_native_code(at_home: dict[str, Any]):
    command = [sys.executable, "-c", "import socket; socket.gethostbyname('cipv.invalid')"]
    with watched(command, **at_home) as (program, calls):
        program.communicate(timeout=WAIT_S)
    assert any(call.leaves for call in calls)


def test_a_run_with_networks_calls_nobody(at_home: dict[str, Any], tmp_path: Path):
    command = [*CIPV, "run", "sim:straight", "--frames", "2", "--rrd", str(tmp_path / "r.rrd"), "--out", "-"]
    with watched(command, **at_home) as (program, calls):
        out, _ = program.communicate(timeout=WAIT_S)
    assert program.returncode == 0
    assert out.count('"version"') == 2
    assert [call for call in calls if call.leaves] == []
    assert left_behind(tmp_path) == []


def test_the_demo_with_both_viewers_calls_nobody(at_home: dict[str, Any], tmp_path: Path):
    with watched([*CIPV, "demo", "--port", "0"], **at_home) as (program, calls):
        assert program.stdout is not None
        address = program.stdout.readline().strip()
        with httpx.Client(base_url=address, timeout=WAIT_S) as page:
            for path in ("/", "/viser/", "/api/rerun/open", "/api/rerun.rrd?first=0&last=1", "/api/help"):
                assert page.get(path).status_code in (200, 404), path
            assert page.get("/rerun/re_viewer.js").status_code == 200
        program.send_signal(signal.SIGINT)
        program.communicate(timeout=WAIT_S)
    assert any(call.address == "127.0.0.1" for call in calls), "the watch was on"
    assert [call for call in calls if call.leaves] == []
    assert left_behind(tmp_path) == []
