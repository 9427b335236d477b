"""Read-only clients do not delay anyone, and work ends when nobody waits for it."""

from __future__ import annotations

import asyncio
import contextlib
import select
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import cast
from urllib.parse import urlsplit

import httpx
import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import Message
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.core.jobs import Cancelled
from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.labels.store.drive_labels import DriveLabels, LabelSetChanges
from app.web.guards import quotas
from app.web.guards.tokens import Tokens
from app.web.routes import rerun
from app.web.server import create_app
from pipeline.common.progress import Progress
from tests.app.waiting import wait_until
from tests.app.web.serving import WAIT_S, running, serving

TOKENS = Tokens("person-0123456789abcdef", "display-0123456789abcde")


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with running(whole_drives=True) as engine:
        engine.wait_for(lambda shown: shown.drive.run is not None, WAIT_S)
        yield engine


@pytest.fixture(scope="module")
def looks() -> SharedViewState:
    return SharedViewState()


@pytest.fixture(scope="module")
def address(engine: Engine, looks: SharedViewState) -> Iterator[str]:
    with serving(create_app(engine, hosts=["0.0.0.0"], tokens=TOKENS, looks=looks)) as address:
        yield address


def as_role(role: str) -> dict[str, str]:
    return {"authorization": f"Bearer {getattr(TOKENS, role)}"}


class Slow:
    """A replay export that never ends by itself."""

    def __init__(self) -> None:
        self.begun, self.cancelled = threading.Semaphore(0), threading.Semaphore(0)

    def __call__(self, clip: object, kind: str, path: object, progress: Progress) -> None:
        self.begun.release()
        try:
            while True:
                threading.Event().wait(0.01)
                progress(0, 1)
        except Cancelled:
            self.cancelled.release()
            raise


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Slow:
    slow = Slow()
    monkeypatch.setattr(rerun, "write_clip", slow)
    return slow


def test_displays_that_ask_for_much_hold_nobody_up_and_what_they_leave_ends(address: str, slow: Slow):
    parts = urlsplit(address)
    asking = f"GET /api/rerun.rrd HTTP/1.1\r\nHost: {parts.netloc}\r\nAuthorization: Bearer {TOKENS.display}\r\n\r\n"
    clients = [socket.create_connection((parts.hostname or "", parts.port or 0), timeout=WAIT_S) for _ in range(60)]
    for client in clients:
        client.sendall(asking.encode())
    allowed = quotas.AT_ONCE["display"]
    assert slow.begun.acquire(timeout=WAIT_S)
    assert wait_until(lambda: len(select.select(clients, [], [], 0)[0]) == 60 - allowed), (
        "the others are refused at once"
    )
    refused = select.select(clients, [], [], 0)[0]
    assert {client.recv(12) for client in refused} == {b"HTTP/1.1 429"}
    for path in ("/healthz", "/api/state", "/metrics", "/"):
        assert httpx.get(address + path, headers=as_role("person"), timeout=WAIT_S).status_code == 200, path
    for client in clients:
        client.close()
    assert slow.cancelled.acquire(timeout=WAIT_S), "what nobody waits for ends"


@pytest.mark.parametrize("path", ["/api/state", "/metrics", "/openapi.json"])
def test_whatever_is_computed_counts(path: str) -> None:
    async def answers() -> list[int]:
        told, goes_on = list[int](), asyncio.Event()

        async def app(*_: object) -> None:
            await goes_on.wait()

        async def send(message: Message) -> None:
            told.extend([message["status"]] if "status" in message else [])

        scope = {"type": "http", "path": path, "headers": [], "state": {"role": "display"}}
        limited = quotas.RoleQuota(app)
        requests = [asyncio.create_task(limited(scope, app, send)) for _ in range(quotas.AT_ONCE["display"] + 2)]  # type: ignore[arg-type]
        done, _ = await asyncio.wait(requests, return_when=asyncio.FIRST_COMPLETED)
        while len(done) < 2:
            await asyncio.sleep(0)
            done = {each for each in requests if each.done()}
        goes_on.set()
        await asyncio.gather(*requests)
        return told

    assert asyncio.run(answers()) == [429, 429]


def test_whole_lists_of_labels_are_made_two_at_a_time(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    two, beside, made = threading.Barrier(2), list[int](), DriveLabels.changes
    lock, running = threading.Lock(), set[int]()

    def counted(labels: DriveLabels, since: int = 0) -> LabelSetChanges:
        with lock:
            running.add(threading.get_ident())
            beside.append(len(running))
        with contextlib.suppress(threading.BrokenBarrierError):
            two.wait(WAIT_S)
        try:
            return made(labels, since)
        finally:
            with lock:
                running.discard(threading.get_ident())

    monkeypatch.setattr(DriveLabels, "changes", counted)
    with ThreadPoolExecutor(8) as clients:
        answers = list(
            clients.map(
                lambda _: httpx.get(f"{address}/api/labels", headers=as_role("person"), timeout=WAIT_S), range(8)
            )
        )
    assert [answer.status_code for answer in answers] == [200] * 8
    assert max(beside) == 2


def test_a_client_that_leaves_is_no_error_of_the_program() -> None:
    class Gone:
        async def is_disconnected(self) -> bool:
            return True

    def work(progress: Progress) -> None:
        while True:
            threading.Event().wait(0.01)
            progress(0, 1)

    with ThreadPoolExecutor(1) as threads, pytest.raises(HTTPException, match="the client disconnected"):
        asyncio.run(quotas.while_waited_for(cast("Request", Gone()), threads, work))


def test_a_display_has_no_say_in_the_3d_view(address: str, looks: SharedViewState):
    url = address.replace("http", "ws") + "/api/stream"
    own = {"origin": address}
    with connect(url, additional_headers=own | as_role("display"), max_size=None, open_timeout=WAIT_S) as display:
        display.send('{"hides_3d": true}')
        display.send('{"ping": 1}')
        while '"pong"' not in str(display.recv(WAIT_S)):
            pass
        assert looks.hiding == 0


def test_displays_have_only_so_many_streams(address: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(quotas.STREAMS, "display", 1)  # type: ignore[arg-type]
    url, own = address.replace("http", "ws") + "/api/stream", {"origin": address}
    with connect(url, additional_headers=own | as_role("display"), max_size=None, open_timeout=WAIT_S) as first:
        assert first.recv(WAIT_S)
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, additional_headers=own | as_role("display"), open_timeout=WAIT_S)
        with connect(url, additional_headers=own | as_role("person"), max_size=None, open_timeout=WAIT_S) as person:
            assert person.recv(WAIT_S)
    assert urlsplit(address).port


def test_whether_it_lives_is_said_without_a_body_too(address: str):
    assert httpx.head(f"{address}/healthz", timeout=WAIT_S).status_code == 200
