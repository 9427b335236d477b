"""A network's own threads give way to the step that runs beside them; who opens it does not."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from pipeline.inference.runtime import open_session
from tests.pipeline.vision import networks

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="niceness is a process's")


def _niceness() -> dict[int, int]:
    """Niceness of each thread of this process, without threads that end meanwhile."""
    found = {}
    for each in map(int, os.listdir("/proc/self/task")):
        with suppress(ProcessLookupError):
            found[each] = os.getpriority(os.PRIO_PROCESS, each)
    return found


def test_a_networks_threads_are_nicer(tmp_path: Path) -> None:
    path = networks.yolox(tmp_path / "tiny.onnx")
    before = _niceness()
    session = open_session(path.read_bytes(), path, 3)
    after = _niceness()
    begun = after.keys() - before.keys()
    assert len(begun) >= 2, "two threads beside the calling one"
    ours = os.getpriority(os.PRIO_PROCESS, 0)
    assert all(after[each] > ours for each in begun)
    assert all(after[each] == before[each] for each in after.keys() & before.keys())
    assert session.get_outputs()


def test_a_system_that_refuses_niceness_still_runs_networks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(which: int, who: int, nice: int) -> None:
        raise PermissionError(1, "not here")

    monkeypatch.setattr(os, "setpriority", refuse)
    path = networks.yolox(tmp_path / "tiny.onnx")
    assert open_session(path.read_bytes(), path, 2).get_outputs()
