"""The page's Time: begun, watched, cancelled; a recording without own motion says what it lacks, and changes
nothing."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from app.engine.engine import Engine
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import WAIT_S, running, serving

TIME = "/api/alignment/time"


@pytest.fixture
def recording() -> Recording:
    return Recording()


@pytest.fixture
def engine(recording: Recording) -> Iterator[Engine]:
    with running(source=recording, whole_drives=True) as engine:
        yield engine


@pytest.fixture
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def ended(client: httpx.Client) -> dict[str, Any]:
    until_s = time.monotonic() + WAIT_S
    while time.monotonic() < until_s:
        now: dict[str, Any] = client.get(TIME).json()
        if now["state"] not in ("waiting", "running"):
            return now
    raise AssertionError(now)


def test_a_drive_that_cannot_tell_says_why(client: httpx.Client, engine: Engine):
    assert client.get(TIME).json() == {"state": "none", "progress": 0.0, "note": "", "result": None}
    assert client.post(TIME).status_code == 202
    told = ended(client)
    assert (told["state"], told["result"]) == ("failed", None)
    assert "no lag between camera and LiDAR stands out" in told["note"]
    assert "ego speed" in told["note"]
    assert engine.control.peek().params == Params()


def test_it_is_cancelled_and_another_can_begin(client: httpx.Client, recording: Recording):
    recording.gate.clear()
    try:
        assert client.post(TIME).status_code == 202
        assert client.post(TIME).status_code == 409
        assert client.post("/api/alignment/fit", json={}).status_code == 202, "a fit of another kind is no obstacle"
        assert client.delete(TIME).status_code == 200
        assert client.get(TIME).json()["state"] == "none"
        assert client.delete(TIME).status_code == 404
        assert client.post(TIME).status_code == 202
    finally:
        recording.gate.set()
    assert ended(client)["state"] == "failed"
