"""The page's Time: begun, watched, cancelled; a recording without own motion says what it lacks, and changes
nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from app.engine.engine import Engine
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import running

Ended = Callable[[str], dict[str, Any]]
TIME = "/api/alignment/time"


@pytest.fixture
def recording() -> Recording:
    return Recording()


@pytest.fixture
def engine(recording: Recording) -> Iterator[Engine]:
    with running(source=recording, whole_drives=True) as engine:
        yield engine


def test_a_drive_that_cannot_tell_says_why(client: httpx.Client, engine: Engine, ended: Ended):
    assert client.get(TIME).json() == {"state": "none", "progress": 0.0, "note": "", "result": None}
    assert client.post(TIME).status_code == 202
    told = ended(TIME)
    assert (told["state"], told["result"]) == ("failed", None)
    assert "no lag between camera and LiDAR stands out" in told["note"]
    assert "ego speed" in told["note"]
    assert engine.control.peek().params == Params()


def test_it_is_cancelled_and_another_can_begin(client: httpx.Client, recording: Recording, ended: Ended):
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
    assert ended(TIME)["state"] == "failed"
