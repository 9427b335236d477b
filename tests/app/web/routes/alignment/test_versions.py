"""Versions of an alignment: saved with a score, restored as one step that can be undone, deleted."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import httpx
import pytest

from app.engine.engine import Engine
from app.web.server import create_app
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import WAIT_S, running, serving

VERSIONS = "/api/alignment/versions"


@pytest.fixture
def engine() -> Iterator[Engine]:
    with running(source=Recording(), whole_drives=True) as engine:
        yield engine


@pytest.fixture
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def test_an_alignment_is_saved_restored_and_the_restoring_undone(client: httpx.Client, engine: Engine):
    assert client.get(VERSIONS).json() == []
    client.patch("/api/params", json={"changes": {"alignment.yaw_deg": 1.25, "alignment.up_m": 0.1}})
    answer = client.post(VERSIONS, json={"note": "after the garage"})
    assert answer.status_code == 201
    saved = answer.json()
    assert saved["is_present"]
    assert (saved["note"], saved["iou"]) == ("after the garage", None)
    assert saved["drive"] == engine.snapshot.title
    assert datetime.fromisoformat(saved["saved_at"]).tzinfo is not None

    client.patch("/api/params", json={"changes": {"alignment.yaw_deg": -3.0, "cluster.z_weight": 0.6}})
    (listed,) = client.get(VERSIONS).json()
    assert not listed["is_present"]
    client.patch("/api/params", json={"changes": listed["values"]})
    restored = engine.control.peek().params
    assert (restored.alignment.yaw_deg, restored.alignment.up_m, restored.cluster.z_weight) == (1.25, 0.1, 0.6)
    assert client.get(VERSIONS).json()[0]["is_present"]
    assert client.post("/api/params/undo").status_code == 200
    assert engine.control.peek().params.alignment.yaw_deg == -3.0

    assert client.delete(f"{VERSIONS}/{saved['id']}").status_code == 200
    assert client.delete(f"{VERSIONS}/{saved['id']}").status_code == 404
    assert client.get(VERSIONS).json() == []


def test_an_applied_fit_is_saved_with_its_overlap(client: httpx.Client, engine: Engine):
    assert client.post("/api/alignment/fit", json={"model": "angular"}).status_code == 202
    while (fit := client.get("/api/alignment/fit").json())["state"] in ("waiting", "running"):
        pass
    before = client.post(VERSIONS, json={}).json()
    assert before["iou"] is None, "not the fit yet"
    client.patch("/api/params", json={"changes": fit["result"]["changes"]})
    assert client.post(VERSIONS, json={}).json()["iou"] == fit["result"]["iou_after"]


def test_a_note_has_an_end(client: httpx.Client):
    assert client.post(VERSIONS, json={"note": "x" * 201}).status_code == 422
    assert client.post(VERSIONS, json={"notes": "x"}).status_code == 422
    assert client.get(VERSIONS).json() == []
