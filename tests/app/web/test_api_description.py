"""OpenAPI says of every route what it does, what it takes and what it answers, and says it truly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute
from prometheus_client.parser import text_string_to_metric_families
from pydantic import BaseModel
from starlette.routing import BaseRoute, Route
from websockets.sync.client import connect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.web.routes.shapes.common import Refusal
from app.web.routes.shapes.parameters import ParamsJson
from app.web.routes.shapes.result import ResultJson
from app.web.routes.shapes.state import SourcesJson, StateJson
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.web.serving import WAIT_S, running, serving

FILES = {
    "/palette.css",
    "/viser",
    "/viser/{path:path}",
    "/viser/of/{name}/{path:path}",
    "/rerun/",
    "/rerun/re_viewer.js",
    "/rerun/re_viewer_bg.wasm",
    "/help",
    "/help/{address:path}",
}
"""Parts of pages and of other programs' viewers, which are not API."""
BYTES = {"type": "string", "format": "binary"}
"""A file in OpenAPI's terms."""


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Engine]:
    with running(SessionRecorder(tmp_path_factory.mktemp("sessions"))) as engine:
        yield engine


@pytest.fixture(scope="module")
def app(engine: Engine) -> FastAPI:
    return create_app(engine)


@pytest.fixture(scope="module")
def client(app: FastAPI) -> Iterator[httpx.Client]:
    with serving(app) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def operations(app: FastAPI) -> dict[str, dict[str, Any]]:
    return {
        f"{method.upper()} {path}": operation
        for path, methods in app.openapi()["paths"].items()
        for method, operation in methods.items()
    }


def routes_of(routes: list[BaseRoute]) -> Iterator[Route]:
    """All routes, including those of routers that are stored as included."""
    for route in routes:
        inner = getattr(route, "original_router", None)
        if inner is not None:
            yield from routes_of(inner.routes)
        elif isinstance(route, Route):
            yield route


def names_of(route: Route) -> set[str]:
    return {f"{method} {route.path}" for method in (route.methods or set()) - {"HEAD", "OPTIONS"}}


def test_every_route_is_described(app: FastAPI):
    answered = {name for route in routes_of(app.routes) for name in names_of(route)}
    assert len(answered) > 40
    unsaid = {name for name in answered - operations(app).keys() if name.split()[1] not in FILES | {"/openapi.json"}}
    assert unsaid == set()


def test_a_route_that_reads_its_body_itself_says_what_it_takes(app: FastAPI):
    """The framework describes only what it reads for a route itself, not the body of one that takes the whole
    request."""
    bare = {
        name
        for route in routes_of(app.routes)
        if isinstance(route, APIRoute) and route.dependant.request_param_name is not None
        for name in names_of(route)
        if name in operations(app) and not name.startswith("GET ")
    }
    assert bare, "labels come as a file"
    assert [name for name in bare if not operations(app)[name].get("requestBody", {}).get("content")] == []


def test_every_operation_says_what_it_does_and_what_it_answers(app: FastAPI):
    wrong = []
    for name, operation in operations(app).items():
        if not operation.get("description"):
            wrong.append(f"{name}: no docstring")
        for status, answer in operation["responses"].items():
            if not status.startswith("2"):
                continue
            for kind, content in answer.get("content", {"": {}}).items():
                if kind in ("", "application/json") and not _is_typed(content.get("schema", {})):
                    wrong.append(f"{name}: {status} {kind or 'nothing'} {content}")
        for content in operation.get("requestBody", {}).get("content", {}).values():
            if not _is_typed(content["schema"]) and not BYTES.items() <= content["schema"].items():
                wrong.append(f"{name}: takes {content}")
    assert wrong == []


def test_a_route_is_called_by_what_it_does(app: FastAPI):
    titles = {name: operation["summary"] for name, operation in operations(app).items()}
    assert titles["GET /api/result"] == "Get the result of the shown frame"
    assert titles["GET /api/jobs/{number}"] == "Get the progress of an export"
    assert [name for name, title in titles.items() if len(title.split()) < 2 or title.endswith(".")] == []


def test_a_refusal_is_described_as_it_is_sent(client: httpx.Client, app: FastAPI):
    refused = {
        404: client.get("/api/jobs/987"),
        409: client.post("/api/params/redo"),
        422: client.patch("/api/params", json={"changes": {"cluster.tolerance_m": "far"}}),
        413: client.post("/api/playback", content=b"{" + b" " * 5_000_000),
        403: client.post("/api/playback", json={}, headers={"origin": "http://elsewhere.example"}),
    }
    assert [answer.status_code for answer in refused.values()] == list(refused)
    for answer in refused.values():
        assert Refusal.model_validate(answer.json()).detail
    for name, operation in operations(app).items():
        schema = operation["responses"]["4XX"]["content"]["application/json"]["schema"]
        assert schema == {"$ref": "#/components/schemas/Refusal"}, name


@pytest.mark.parametrize(
    ("body", "kind", "said"),
    [
        (b"{playing: yes", "application/json", "the body is not valid JSON: "),
        (b"[1, 2]", "application/json", "the body must be a JSON object"),
        (b"{}", "text/plain", "the body must be a JSON object"),
    ],
)
def test_a_body_that_is_none_is_said_in_words(client: httpx.Client, body: bytes, kind: str, said: str):
    answer = client.post("/api/playback", content=body, headers={"content-type": kind})
    assert (answer.status_code, answer.json()["detail"].startswith(said)) == (422, True), answer.text


def _is_typed(schema: dict[str, Any]) -> bool:
    """A model of this project, a list of one, or an optional one."""
    return (
        "$ref" in schema or "$ref" in schema.get("items", {}) or any("$ref" in one for one in schema.get("anyOf", []))
    )


def test_every_model_has_words(app: FastAPI):
    models = app.openapi()["components"]["schemas"]
    own = {name: model for name, model in models.items() if "Validation" not in name}
    assert [name for name, model in own.items() if not model.get("description") and "enum" not in model] == []


def test_every_field_has_words(app: FastAPI):
    models = app.openapi()["components"]["schemas"]
    own = {name: model for name, model in models.items() if "Validation" not in name}
    fields = {f"{name}.{key}": each for name, model in own.items() for key, each in model.get("properties", {}).items()}
    assert len(fields) > 300
    assert {name for name, each in fields.items() if not each.get("description") and "const" not in each} == set()


ANSWERS: dict[str, type[BaseModel]] = {
    "/api/state": StateJson,
    "/api/result": ResultJson,
    "/api/params": ParamsJson,
    "/api/sources": SourcesJson,
}


@pytest.mark.parametrize("path", ANSWERS)
def test_what_is_said_of_an_answer_is_what_is_in_it(client: httpx.Client, engine: Engine, path: str):
    engine.control.seek(20)
    engine.wait_for(lambda shown: shown.index == 20 and shown.processed is not None, WAIT_S)
    answer = client.get(path).json()
    model = ANSWERS[path].model_validate(answer)
    assert model.model_dump(exclude_unset=True).keys() == answer.keys() == ANSWERS[path].model_fields.keys()
    if path == "/api/result":
        assert answer["cipv"] is not None
        assert answer["objects"]


# ------------------------------------------------------------ figures


def figures(client: httpx.Client) -> dict[str, float]:
    text = client.get("/metrics").text
    return {
        sample.name + (sample.labels.get("le", "") and f"<={sample.labels['le']}"): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_the_figures_follow_what_happens(client: httpx.Client, engine: Engine):
    before = figures(client)
    assert before["cipv_engine_up"] == 1
    assert before["cipv_clients"] == 0
    assert before["cipv_recording_bytes"] == 0
    url = str(client.base_url).replace("http", "ws") + "/api/stream"
    with connect(url, max_size=None, open_timeout=WAIT_S) as socket:
        socket.recv(WAIT_S)
        assert figures(client)["cipv_clients"] == 1
        sequence = engine.snapshot.sequence
        engine.recorder.start(engine.source)
        engine.control.step(3)
        engine.wait_for(lambda shown: shown.sequence > sequence and shown.recording is not None, WAIT_S)
        engine.control.change_params({"cluster.tolerance_m": 0.8})
        engine.wait_for(lambda shown: shown.params.cluster.tolerance_m == 0.8 and shown.sequence > sequence + 1, WAIT_S)
        now = figures(client)
        engine.recorder.stop()
    assert now["cipv_frames_total"] > before["cipv_frames_total"]
    assert now["cipv_line_seconds_count"] > before["cipv_line_seconds_count"]
    assert now["cipv_line_seconds_sum"] > before["cipv_line_seconds_sum"]
    assert now["cipv_result_to_sent_seconds_count"] > before["cipv_result_to_sent_seconds_count"]
    assert now["cipv_client_frames_sent_total"] > before["cipv_client_frames_sent_total"]
    assert now["cipv_detector_seconds_count"] > 0
    assert now["cipv_frames_per_second"] > 0
    assert now["cipv_recording"] == 1
    assert now["cipv_recording_frames"] >= 0
    assert now["process_resident_memory_bytes"] > 0


def test_health_says_when_the_worker_has_ended():
    engine = Engine(opener(Recording()), None, Params())
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        answer = client.get("/healthz")
        assert (answer.status_code, answer.json()) == (503, {"status": "failed", "engine": False})
        engine.start()
        assert client.get("/healthz").json() == {"status": "ok", "engine": True}
        engine.stop()
        assert client.get("/healthz").status_code == 503
