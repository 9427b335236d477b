"""The page's Fit: begun, watched, applied as one step that can be undone, saved, cancelled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from app.engine.engine import Engine
from pipeline.params import Params, from_yaml
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import running

Ended = Callable[[str], dict[str, Any]]
FIT = "/api/alignment/fit"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return Recording()


@pytest.fixture(scope="module")
def engine(recording: Recording) -> Iterator[Engine]:
    with running(source=recording, whole_drives=True) as engine:
        yield engine


def test_a_fit_is_applied_on_consent_and_undone_in_one_step(
    client: httpx.Client, engine: Engine, tmp_path: Any, ended: Ended
):
    assert client.get(FIT).json() == {"state": "none", "progress": 0.0, "note": "", "result": None}
    assert client.get(f"{FIT}.yaml").status_code == 404
    assert client.post(FIT, json={"model": "angular"}).status_code == 202
    fitted = ended(FIT)
    assert (fitted["state"], fitted["progress"]) == ("done", 1.0)
    result = fitted["result"]
    assert result["pairs"] >= 12
    assert any("one direction" in warning for warning in result["warnings"]), "the only car is straight ahead"
    assert engine.control.peek().params == Params(), "nothing is changed before somebody says so"

    file = tmp_path / "fit.yaml"
    file.write_bytes(client.get(f"{FIT}.yaml").content)
    answer = client.patch("/api/params", json={"changes": result["changes"]}).json()
    assert from_yaml(file, Params()) == engine.control.peek().params
    assert answer["values"]["alignment.model"] == "angular"
    assert client.post("/api/params/undo").status_code == 200
    assert engine.control.peek().params == Params()


def test_a_fit_is_cancelled_and_another_can_begin(client: httpx.Client, recording: Recording, ended: Ended):
    recording.gate.clear()
    try:
        assert client.post(FIT, json={}).status_code == 202
        assert client.post(FIT, json={}).status_code == 409
        assert client.delete(FIT).status_code == 200
        assert client.get(FIT).json()["state"] == "none"
        assert client.delete(FIT).status_code == 404
        assert client.post(FIT, json={}).status_code == 202
    finally:
        recording.gate.set()
    assert ended(FIT)["state"] == "done"


def test_unknown_models_are_refused(client: httpx.Client):
    assert client.post(FIT, json={"model": "fisheye"}).status_code == 422
