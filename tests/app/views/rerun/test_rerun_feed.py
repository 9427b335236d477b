"""Streaming to a rerun viewer that runs beside, here the installed program that only saves what it gets."""

from __future__ import annotations

import importlib.util
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.engine.engine import Engine
from app.views.rerun.feed import RerunFeed
from app.views.rerun.view import ReplayError
from app.views.rerun.web import free_ports
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.waiting import wait_until

WAIT_S = 180.0


@pytest.fixture
def engine() -> Iterator[Engine]:
    engine = Engine(opener(Recording()), lambda _: CountingDetector(), Params(), uri="test:car")
    engine.start()
    engine.wait_for(lambda s: s.processed is not None, WAIT_S)
    yield engine
    engine.stop()


def wait_sent(feed: RerunFeed, count: int) -> None:
    assert wait_until(lambda: feed.sent >= count)


def test_shown_frames_reach_a_viewer_also_one_that_comes_late(engine: Engine, tmp_path: Path):
    spec = importlib.util.find_spec("rerun_cli")
    assert spec is not None
    assert spec.submodule_search_locations
    program = Path(spec.submodule_search_locations[0]) / "rerun"
    (port,) = free_ports(1)
    saved = tmp_path / "got.rrd"
    environment = {"HOME": str(tmp_path), "CI": "true", "PATH": os.environ["PATH"]}
    with RerunFeed(engine, f"rerun+http://127.0.0.1:{port}/proxy") as feed:
        engine.control.seek(3)
        engine.wait_for(lambda s: s.index == 3, WAIT_S)
        assert feed.sent == 0, "nobody is there yet, and nobody waits"
        command = [str(program), "--save", str(saved), "--bind", "127.0.0.1", "--port", str(port)]
        viewer = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            wait_sent(feed, 1)
            engine.control.seek(5)
            wait_sent(feed, 2)
            is_saved = wait_until(lambda: saved.exists() and saved.stat().st_size > 20_000)
        finally:
            viewer.kill()
            viewer.wait()
    assert is_saved, "a sweep and an image"


@pytest.mark.parametrize("url", ["", "nowhere", "http://127.0.0.1:9876", "rerun+http://127.0.0.1/proxy"])
def test_what_is_no_viewers_address_is_said(engine: Engine, url: str):
    with pytest.raises(ReplayError, match="not the address of a rerun viewer"):
        RerunFeed(engine, url)
