"""Health checks and the stream of frames need no thread that other requests use, and no disk: whatever these wait for,
the event loop answers."""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI
from starlette.responses import Response
from starlette.routing import Route
from websockets.sync.client import ClientConnection, connect

from app.engine.engine import Engine
from app.streaming.encode import Encoder
from app.web.guards import accounts, audit
from app.web.guards.accounts import Accounts, add_account
from app.web.guards.tokens import Tokens
from app.web.page_files import PageFiles
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, running, serving
from tests.app.web.test_api_description import routes_of

PERSON = "person-0123456789abcdef"
OWN = {"authorization": f"Bearer {PERSON}"}
POOL = 40
"""Threads that answer all requests: anyio's default."""
ON_THE_LOOP = {
    "/healthz": "needs no thread",
    "/api/healthz": "needs no thread",
    "/api/labels": "waits for a pool of its own",
    "/api/rerun.rrd": "waits for a pool of its own",
    "/api/labels/import": "passes each piece of the file to a thread",
    "/viser/of/{name}/{path:path}": "asks viser on a thread",
    "/viser/{path:path}": "asks viser on a thread",
}
"""Routes that are answered by the event loop, where they may neither compute nor read files."""


class Hanging:
    """A function that hangs until the end of the block, however long that takes."""

    def __init__(self) -> None:
        self.begun, self.goes_on = threading.Semaphore(0), threading.Event()

    def __call__(self, *_: object, **__: object) -> None:
        self.begun.release()
        self.goes_on.wait()

    def __enter__(self) -> Hanging:
        return self

    def __exit__(self, *_: object) -> None:
        self.goes_on.set()

    def has_begun(self, times: int = 1) -> bool:
        return all(self.begun.acquire(timeout=WAIT_S) for _ in range(times))


@pytest.fixture
def engine() -> Iterator[Engine]:
    with running() as engine:
        yield engine


@pytest.fixture
def app(engine: Engine, tmp_path: Path) -> FastAPI:
    add_account("Ada", "labeler", tmp_path / "accounts.json")
    tokens = Tokens(PERSON, "display-0123456789abcde", accounts=Accounts(tmp_path / "accounts.json"))
    return create_app(engine, tokens=tokens, audit=tmp_path / "audit.jsonl")


def is_healthy(address: str) -> bool:
    return all(
        httpx.request(method, f"{address}/healthz", timeout=WAIT_S).status_code == 200 for method in ("GET", "HEAD")
    )


@contextmanager
def page(address: str, query: str = "") -> Iterator[ClientConnection]:
    url = f"{address.replace('http', 'ws')}/api/stream{query}"
    with connect(url, additional_headers=OWN, max_size=None, open_timeout=WAIT_S, close_timeout=0.5) as stream:
        yield stream


def gets_frames(stream: ClientConnection, go: Callable[[], object]) -> bool:
    """Whether a frame arrives after ``go``."""
    stream.send('{"ping": 1}')
    while isinstance(message := stream.recv(WAIT_S), bytes) or '"pong"' not in message:
        pass  # what was sent before
    go()
    while not isinstance(stream.recv(WAIT_S), bytes):
        pass
    return True


def test_with_all_threads_of_the_api_occupied_health_and_frames_go_on(engine: Engine, app: FastAPI):
    hanging = Hanging()
    app.router.routes.insert(0, Route("/hangs", lambda _: hanging() or Response()))  # outside the API, which has quotas
    with (
        serving(app) as address,
        page(address) as shared,
        page(address, "?own=3") as own,
        ThreadPoolExecutor(POOL + 1) as clients,
        hanging,
    ):
        for _ in range(POOL + 1):
            clients.submit(httpx.get, f"{address}/hangs", headers=OWN, timeout=WAIT_S)
        assert hanging.has_begun(POOL)
        assert not hanging.begun.acquire(blocking=False), "all threads are occupied"
        assert is_healthy(address)
        assert gets_frames(shared, lambda: engine.control.seek(5))
        assert gets_frames(own, lambda: own.send('{"own": 7}'))
        with page(address) as late:
            assert late.recv(WAIT_S)


def test_while_a_frame_is_encoded_health_is_answered_and_pages_come_and_go(
    engine: Engine, app: FastAPI, monkeypatch: pytest.MonkeyPatch
):
    with serving(app) as address, page(address) as shared, Hanging() as hanging:
        shared.recv(WAIT_S)
        monkeypatch.setattr(Encoder, "message", hanging)
        engine.control.seek(5)
        assert hanging.has_begun()
        with page(address, "?picture_px=2000") as wider:
            wider.send('{"picture_px": 1000}')
            wider.send('{"ping": 1}')
        assert is_healthy(address)


def test_a_disk_of_the_audit_log_that_hangs_holds_up_nothing(app: FastAPI, monkeypatch: pytest.MonkeyPatch):
    with serving(app) as address, Hanging() as hanging:
        monkeypatch.setattr(audit._PrivateFile, "emit", hanging)
        for _ in range(3):
            assert httpx.post(f"{address}/api/marks", json={"text": ""}, headers=OWN, timeout=WAIT_S).is_success
        assert hanging.has_begun()
        assert is_healthy(address)


def test_more_entries_than_may_wait_for_the_disk_are_said_to_be_missing(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(audit, "_MOST_WAITING", 1)
    with serving(create_app(engine, audit=tmp_path / "audit.jsonl")) as address, Hanging() as hanging:
        monkeypatch.setattr(audit._PrivateFile, "emit", hanging)
        for _ in range(4):
            httpx.post(f"{address}/api/marks", json={"text": ""}, timeout=WAIT_S).raise_for_status()
    assert any("changes are not logged: the disk does not respond" in each for each in caplog.messages)


def test_a_disk_of_the_accounts_that_hangs_holds_up_only_those_that_it_would_let_in(
    app: FastAPI, monkeypatch: pytest.MonkeyPatch
):
    with serving(app) as address, ThreadPoolExecutor(1) as client, Hanging() as hanging:
        monkeypatch.setattr(accounts, "_changed_at", hanging)
        answer = client.submit(httpx.get, f"{address}/api/state", headers={"authorization": "Bearer x"}, timeout=WAIT_S)
        assert hanging.has_begun()
        assert is_healthy(address)
        assert httpx.get(f"{address}/api/state", headers=OWN, timeout=WAIT_S).is_success
        hanging.goes_on.set()
        assert answer.result(WAIT_S).status_code == 401


@pytest.mark.parametrize("path", ["/drive/", "/js/app.js?v=1"])
def test_a_disk_of_the_pages_that_hangs_holds_up_only_pages(app: FastAPI, monkeypatch: pytest.MonkeyPatch, path: str):
    with serving(app) as address, ThreadPoolExecutor(1) as client, Hanging() as hanging:
        monkeypatch.setattr(PageFiles, "_file", hanging)
        client.submit(httpx.get, f"{address}{path}", headers=OWN, timeout=WAIT_S)
        assert hanging.has_begun()
        assert is_healthy(address)
        assert httpx.get(f"{address}/api/state", headers=OWN, timeout=WAIT_S).is_success


def test_every_route_that_the_event_loop_answers_is_known(app: FastAPI):
    """Those of the framework too: its own description of the API is made there."""
    routes = routes_of(app.routes)
    assert {each.path for each in routes if inspect.iscoroutinefunction(each.endpoint)} == set(ON_THE_LOOP)
