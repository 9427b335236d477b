"""No command, page or viewer calls another machine or looks a name up, or leaves an identity behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from app.cli import COMMANDS
from tests.network_watch import cannot_watch, watched
from tests.pipeline.sources.live.rig import loopback_config

ROOT = Path(__file__).resolve().parents[2]
WAIT_S = 180.0
CIPV = [sys.executable, "-c", "from app.cli import main; main()"]
pytestmark = pytest.mark.skipif(cannot_watch() is not None, reason=cannot_watch() or "")


@pytest.fixture
def at_home(tmp_path: Path) -> dict[str, Any]:
    """The environment of a program whose user has an empty home folder."""
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / ".cache"), "CIPV_HOME": str(tmp_path / "cipv")}
    return {
        "cwd": ROOT,
        "env": os.environ | {"PYTHONPATH": str(ROOT)} | home,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }


def left_behind(home: Path) -> list[Path]:
    """Files in a home folder that look like telemetry: a device's or user's identity, or a queue of events."""
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


SCENE = """
title: a car ahead
duration_s: 1.0
rate_hz: 5
road: {segments: [{length_m: 1000}]}
ego: {lane: -2, speed_mps: {0: 10}}
actors:
  - {id: 1, kind: car, lane: -2, ahead_m: 18, speed_mps: {0: 10}}
"""
BATCH = ["--out", "tables", "--workers", "1"]
SOME_LINES = """
import json, sys
from app.cli import main
if __name__ == "__main__":
    for typed in json.loads(sys.argv[1]):
        try:
            main(typed)
        except SystemExit as end:
            print(json.dumps([typed[0], end.code]), file=sys.stderr)
"""
"""Several commands in one process, since importing takes longer than running most of them."""
TYPED: dict[str, list[list[str]]] = {
    "sessions": [
        ["record", "sim:scene.yaml", "--out", "a.mcap"],
        ["import", "a.mcap", "--out", "b.mcap"],
        ["export", "b.mcap", "--csv", "c.csv", "--rrd", "c.rrd"],
        ["info", "b.mcap"],
        ["recover", "b.mcap"],
        ["keys", "new", "key"],
        ["accounts", "--add", "Ada", "--role", "labeler"],
        ["params", "--yaml"],
        ["models", "list"],
    ],
    "labels": [
        ["labels", "propose", "sim:scene.yaml"],
        ["labels export", "sim:scene.yaml", "--format", "native", "--out", "labels.json"],
        ["labels import", "sim:scene.yaml", "labels.json", "--format", "native"],
        ["evaluate", "sim:scene.yaml", "--report", "scores.html"],
    ],
    "calibrating": [
        ["calibrate", "distance", "sim:scene.yaml", "--truth", "lidar"],
        ["calibration", "sim:scene.yaml", "--out", "rig.yaml"],
    ],
    "live sensors": [
        ["live", "check", "car.yaml", "--seconds", "0.2"],
        ["replay", "sim:scene.yaml", "--config", "car.yaml"],
    ],
    "experiments": [["scenarios", "run", "--suite", "braking", "--short", "--jobs", "1"], ["bench", "--drives", "20"]],
    "fleets": [
        ["record", "sim:scene.yaml", "--out", "a.mcap"],
        ["batch", "a.mcap", *BATCH],
        ["sweep", "a.mcap", *BATCH, "--over", "cipv.confirm_hits=2,3"],
        ["find", "true", "--out", "tables"],
        ["scores", "--out", "tables"],
        ["mine", "--out", "tables"],
        ["sync", "copies", "--from", "."],
        ["compare", "--out", "tables", "--base", "no such run"],
    ],
}
"""Other commands that a user may type, besides ``run`` and ``demo``, which is ``serve`` on the simulator."""
ENDS = {"live": 1, "compare": 2}
"""Exit codes other than 0: no sensor is connected, the run does not exist."""


def test_every_command_is_watched_here():
    typed = {line[0] for lines in TYPED.values() for line in lines} | {"run", "demo", "serve"}
    assert typed == set(COMMANDS)


@pytest.mark.parametrize("group", TYPED)
def test_no_command_calls_another_machine(at_home: dict[str, Any], tmp_path: Path, group: str):
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "car.yaml").write_text(yaml.safe_dump(loopback_config().model_dump(mode="json", exclude_none=True)))
    lines = [[*line[0].split(), *line[1:]] for line in TYPED[group]]
    at_home |= {"cwd": tmp_path, "stderr": subprocess.PIPE}
    at_home["env"] |= {"CIPV_LABELS_URL": f"sqlite:///{tmp_path}/labels.db"}
    with watched([sys.executable, "-c", SOME_LINES, json.dumps(lines)], **at_home) as (program, calls):
        _, said = program.communicate(timeout=3 * WAIT_S)
    ends = [json.loads(line) for line in said.splitlines() if line.startswith('["')]
    assert ends == [[line[0], ENDS.get(line[0], 0)] for line in lines], said
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
