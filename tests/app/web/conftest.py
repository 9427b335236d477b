"""A server with two recordings, the first one open, paused on its first frame before each test."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import httpx
import pytest
from websockets.sync.client import ClientConnection, connect

from app.core.server_address import listen_socket
from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.web.server import Server, create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.web.asking import WAIT_S


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    """An engine with two recordings, the first one open."""
    first, second = Recording(), Recording("test:other", count=5)
    engine = Engine(opener(first, second), lambda _: CountingDetector(), Params(), uri=first.uri)
    engine.start()
    engine.wait_for(lambda shown: shown.processed is not None, WAIT_S)
    yield engine
    engine.stop()


@pytest.fixture(scope="module")
def looks() -> SharedViewState:
    return SharedViewState()


@pytest.fixture(scope="module")
def address(engine: Engine, looks: SharedViewState) -> Iterator[str]:
    """Address of a real server."""
    bound = listen_socket("127.0.0.1", 0)
    address = f"http://127.0.0.1:{bound.getsockname()[1]}"
    is_ready = threading.Event()
    server = Server(create_app(engine, looks=looks), address, lambda _: is_ready.set())
    thread = threading.Thread(target=lambda: server.run(sockets=[bound]))
    thread.start()
    assert is_ready.wait(WAIT_S)
    yield address
    server.should_exit = True
    thread.join()
    bound.close()


@pytest.fixture(scope="module")
def client(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


@pytest.fixture
def stream(address: str) -> Callable[..., ClientConnection]:
    """Opens a stream, by default with the server's own origin."""

    def begin(query: str = "", **headers: str) -> ClientConnection:
        own = {"origin": address} | headers
        url = address.replace("http", "ws") + "/api/stream" + query
        return connect(url, additional_headers=own, max_size=None, open_timeout=WAIT_S, compression=None)

    return begin


@pytest.fixture(autouse=True)
def _at_the_start(engine: Engine) -> None:
    """Each test starts at the first frame of the first recording, with default parameters."""
    held = engine.snapshot.processed
    old = held.frame if held is not None else None
    engine.control.change(uri="test:car", playing=False, target=None, steps=0)
    revision = engine.control.set_params(Params(), "default")
    engine.wait_for(
        lambda s: (
            (s.uri, s.index, s.params_revision) == ("test:car", 0, revision)
            and s.processed is not None
            and s.processed.frame is not old
        ),
        WAIT_S,
    )
