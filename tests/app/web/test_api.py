"""The API over a running engine, as scripts and pages use it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
import yaml
from websockets.sync.client import ClientConnection

from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.web.routes import params
from pipeline.params import Params, from_yaml
from pipeline.types import REAL_VEHICLES
from pipeline.types.result_json import to_json
from tests.app.web.asking import WAIT_S, reach


def test_health_state_and_result(client: httpx.Client, engine: Engine):
    assert client.get("/api/healthz").json() == {"status": "ok", "engine": True}
    assert client.get("/api/state").json()["title"] == "a car"
    tick = engine.snapshot.processed
    assert tick is not None
    assert client.get("/api/result").json() == json.loads(json.dumps(to_json(tick.result)))


def test_every_parameter_is_described_with_bounds_unit_and_help(client: httpx.Client):
    answer = client.get("/api/params").json()
    described = {f"{s['name']}.{p['key']}": p for s in answer["sections"] for p in s["params"]}
    assert described.keys() == answer["values"].keys() == answer["base"].keys()
    assert all(p["help"] for p in described.values())
    numbers = [p for p in described.values() if p["kind"] in ("number", "integer")]
    assert numbers
    assert all(p["min"] < p["max"] and p["step"] > 0 for p in numbers)
    assert described["cluster.tolerance_m"]["unit"] == "m"
    assert described["alignment.model"]["choices"] == ["angular", "pinhole"]
    assert described["alignment.h_res_deg"]["nullable"]


def test_what_never_changes_is_described_once(client: httpx.Client, monkeypatch: pytest.MonkeyPatch):
    """A dragged slider sends ten requests per second, while the frame is run again."""
    first = client.get("/api/params").json()
    described: list[str] = []
    monkeypatch.setattr(params, "describe", lambda: described.append("sections"))
    monkeypatch.setattr(params, "preset", described.append)
    again = client.patch("/api/params", json={"changes": {"cluster.tolerance_m": 0.61}, "final": False}).json()
    try:
        assert described == []
        assert again["values"]["cluster.tolerance_m"] == 0.61
        assert (again["sections"], again["base"]) == (first["sections"], first["base"])
    finally:
        client.patch("/api/params", json={"changes": {"cluster.tolerance_m": first["values"]["cluster.tolerance_m"]}})


def test_what_null_means_comes_from_the_calibration(client: httpx.Client):
    effective = client.get("/api/params").json()["effective"]
    assert effective["alignment.h_res_deg"] == pytest.approx(57.29578 / 250, abs=1e-4)
    assert effective["alignment.cx_px"] == 160.0


def test_what_null_means_of_the_distance_law_is_the_detectors_own(client: httpx.Client):
    answer = client.get("/api/params").json()
    assert answer["values"]["distance.coefficient"] is None
    assert answer["effective"]["distance.coefficient"] == REAL_VEHICLES.coefficient
    assert answer["effective"]["distance.truck_ratio"] == REAL_VEHICLES.truck_ratio
    try:
        client.patch("/api/params", json={"changes": {"distance.reference_focal_px": 907.0 * 2}})
        effective = client.get("/api/params").json()["effective"]
        assert effective["distance.coefficient"] == pytest.approx(2 * REAL_VEHICLES.coefficient), "boxes twice as tall"
    finally:
        client.patch("/api/params", json={"changes": {"distance.reference_focal_px": 907.0}})


def test_the_saved_file_is_taken_back_by_the_command_line(client: httpx.Client, tmp_path: Path):
    client.patch("/api/params", json={"changes": {"cluster.z_weight": 0.65}})
    file = tmp_path / "saved.yaml"
    file.write_bytes(client.get("/api/params.yaml").content)
    assert yaml.safe_load(file.read_text())["cluster"]["z_weight"] == 0.65
    assert from_yaml(file, Params()).cluster.z_weight == 0.65


def test_scenarios_are_offered(client: httpx.Client):
    assert "sim:straight" in [each["uri"] for each in client.get("/api/sources").json()["sources"]]


def test_the_api_describes_itself(client: httpx.Client):
    paths = client.get("/openapi.json").json()["paths"]
    assert {"/api/state", "/api/params", "/api/playback", "/api/source", "/api/result"} <= paths.keys()
    operations = [operation for path in paths.values() for operation in path.values()]
    assert all(operation.get("summary") and operation.get("description") for operation in operations)


def test_playback_is_obeyed(client: httpx.Client, engine: Engine):
    client.post("/api/playback", json={"seek": 12})
    reach(engine, lambda s: s.index == 12)
    client.post("/api/playback", json={"step": -2})
    reach(engine, lambda s: s.index == 10)
    client.post("/api/playback", json={"playing": True, "speed": 4.0, "loop": False})
    assert reach(engine, lambda s: s.playing and s.index > 10).speed == 4.0


def test_a_changed_parameter_is_in_the_next_result(client: httpx.Client, engine: Engine):
    before = client.get("/api/result").json()
    answer = client.patch("/api/params", json={"changes": {"detection.min_score": 0.9}}).json()
    reach(engine, lambda s: s.params_revision == answer["revision"])
    assert client.get("/api/result").json()["objects"] != before["objects"]
    assert answer["values"]["detection.min_score"] == 0.9
    assert answer["base"]["detection.min_score"] == Params().detection.min_score


def test_a_preset_replaces_everything(client: httpx.Client):
    client.patch("/api/params", json={"changes": {"cluster.z_weight": 0.65}})
    answer = client.post("/api/params/preset", json={"name": "paper"}).json()
    assert answer["preset"] == "paper"
    assert answer["values"] == answer["base"]
    assert answer["values"]["alignment.model"] == "angular"


def test_another_recording_is_opened(client: httpx.Client, engine: Engine):
    assert client.post("/api/source", json={"uri": "test:other"}).status_code == 202
    assert reach(engine, lambda s: s.uri == "test:other" and s.processed is not None).count == 5


REFUSED = {
    "unknown parameter": ("PATCH", "/api/params", {"changes": {"cluster.nonsense": 1}}, "cluster.nonsense"),
    "out of bounds": ("PATCH", "/api/params", {"changes": {"cluster.z_weight": 7}}, "cluster.z_weight"),
    "not a number": ("PATCH", "/api/params", {"changes": {"cluster.z_weight": "much"}}, "cluster.z_weight"),
    "no changes": ("PATCH", "/api/params", {"changes": {}}, "changes"),
    "unknown preset": ("POST", "/api/params/preset", {"name": "nonsense"}, "nonsense"),
    "negative seek": ("POST", "/api/playback", {"seek": -1}, "seek"),
    "speed of nothing": ("POST", "/api/playback", {"speed": 0}, "speed"),
    "unknown field": ("POST", "/api/playback", {"rewind": True}, "rewind"),
    "no source": ("POST", "/api/source", {"uri": ""}, "uri"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_refused_with_one_sentence(client: httpx.Client, name: str):
    method, path, body, about = REFUSED[name]
    before = client.get("/api/params").json()["values"]
    answer = client.request(method, path, json=body)
    assert answer.status_code == 422
    assert about in answer.json()["detail"]
    assert "\n" not in answer.json()["detail"]
    assert client.get("/api/params").json()["values"] == before


def test_what_is_picked_in_the_3d_view_comes_to_its_page(
    looks: SharedViewState, stream: Callable[..., ClientConnection]
):
    page = stream()
    page.recv(timeout=WAIT_S)
    page.send(json.dumps({"page_3d": "a" * 32, "ping": 1}))
    next(words for words in page if isinstance(words, str) and '"pong"' in words)
    looks.pick("a" * 32, 7)
    told = (json.loads(words) for words in page if isinstance(words, str))
    assert next(word for word in told if word["type"] == "selected") == {"type": "selected", "id": 7}
