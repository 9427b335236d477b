"""viser behind the one web port: a real viser server, a real web server on loopback, a client like the browser's."""

from __future__ import annotations

import gzip
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from starlette.requests import HTTPConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.views.viser.internal_port import HEADERS
from app.views.viser.proxy import POLICY, viser_router
from app.views.viser.view import ViserView
from pipeline.params import Params
from pipeline.types import Frame, Result


class Web(uvicorn.Server):
    """A web server on a free loopback port, in a thread of its own."""

    def __init__(self, get_port: Callable[[], int | None], allowed: Callable[[HTTPConnection], bool]) -> None:
        app = FastAPI()
        app.include_router(viser_router(get_port, allowed))
        super().__init__(uvicorn.Config(app, log_level="error", lifespan="off", ws_per_message_deflate=False))
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]
        self.origin = f"http://127.0.0.1:{self.port}"
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self.run, kwargs={"sockets": [self._socket]})

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready.set()

    def __enter__(self) -> Web:
        self._thread.start()
        assert self._ready.wait(180)
        return self

    def __exit__(self, *_: object) -> None:
        self.should_exit = self.force_exit = True
        self._thread.join(20)

    def get(self, path: str, **options: Any) -> httpx.Response:
        return httpx.get(self.origin + path, trust_env=False, timeout=180, **options)


@pytest.fixture
def view() -> Iterator[ViserView]:
    view = ViserView(Params())
    yield view
    view.close()


@pytest.fixture
def web(view: ViserView) -> Iterator[Web]:
    with Web(lambda: view.port, lambda _: True) as web:
        yield web


def test_the_page_comes_through_with_a_policy_of_its_own(web: Web, view: ViserView) -> None:
    answer = web.get("/viser/")
    direct = httpx.get(f"http://127.0.0.1:{view.port}/", headers=HEADERS, trust_env=False)
    assert (answer.status_code, answer.content) == (200, direct.content)
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-security-policy"] == POLICY
    assert "'unsafe-eval'" not in POLICY


def test_the_page_stays_packed_for_a_browser_that_unpacks(web: Web) -> None:
    with httpx.stream("GET", f"{web.origin}/viser/", headers={"accept-encoding": "gzip"}, trust_env=False) as answer:
        assert answer.headers["content-encoding"] == "gzip"
        assert b"<html" in gzip.decompress(b"".join(answer.iter_raw()))


def test_without_its_slash_the_address_leads_to_the_page(web: Web) -> None:
    answer = web.get("/viser?initialCameraFov=1")
    assert (answer.status_code, answer.headers["location"]) == (307, "/viser/?initialCameraFov=1")


def test_a_file_that_viser_has_not_is_not_found(web: Web) -> None:
    assert web.get("/viser/nothing.js").status_code == 404
    assert web.get("/viser/%2e%2e/%2e%2e/_viser.py").status_code == 404


def test_the_scene_comes_through(web: Web, view: ViserView, frame: Frame, result: Result, open_scene: Any) -> None:
    view.show(frame, result)
    client = open_scene(web.port, "/viser", origin=web.origin)
    client.read_present_state()
    assert client.nodes()["/points"]
    client.read_names("#7 car 19.9 m")


def test_sliders_come_through_the_other_way(open_scene: Any) -> None:
    heard, moved = threading.Event(), []
    view = ViserView(Params(), lambda name, value: (moved.append((name, value)), heard.set()))  # type: ignore[arg-type, return-value]
    try:
        with Web(lambda: view.port, lambda _: True) as web:
            client = open_scene(web.port, "/viser", origin=web.origin)
            client.read_present_state()
            client.move(client.inputs("Z weight")[0]["uuid"], 0.25)
            assert heard.wait(180)
    finally:
        view.close()
    assert moved == [("cluster.z_weight", 0.25)]


def test_a_scene_of_many_megabytes_comes_through_whole(web: Web, view: ViserView, open_scene: Any) -> None:
    points = np.random.default_rng(0).normal(size=(400_000, 3)).astype(np.float32)
    view._server.scene.add_point_cloud("/large", points, (1, 2, 3), precision="float32")
    client = open_scene(web.port, "/viser", origin=web.origin)
    client.read_present_state()
    assert client.largest > points.nbytes


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_a_page_of_another_origin_is_refused(web: Web, open_scene: Any, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        open_scene(web.port, "/viser", origin=origin)
    assert refused.value.response.status_code == 403


def test_a_program_names_no_origin_and_may_look(web: Web, open_scene: Any) -> None:
    open_scene(web.port, "/viser/").read_present_state()


def test_whom_the_application_does_not_allow_gets_neither_page_nor_scene(view: ViserView, open_scene: Any) -> None:
    with Web(lambda: view.port, lambda connection: connection.headers.get("x-token") == "right") as web:
        assert web.get("/viser/").status_code == 403
        assert web.get("/viser/", headers={"x-token": "right"}).status_code == 200
        with pytest.raises(InvalidStatus) as refused:
            open_scene(web.port, "/viser", origin=web.origin)
        assert refused.value.response.status_code == 403
        client = open_scene(web.port, "/viser", origin=web.origin, additional_headers={"x-token": "right"})
        client.read_present_state()


def test_another_version_of_the_page_hears_why_it_is_turned_away(web: Web, open_scene: Any) -> None:
    client = open_scene(web.port, "/viser", version="0.0.1", origin=web.origin)
    with pytest.raises(ConnectionClosed) as closed:
        client.read_present_state()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1002
    assert "Version mismatch" in closed.value.rcvd.reason


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("get_port", [lambda: None, _free_port], ids=["never started", "gone"])
def test_without_viser_there_is_a_sentence(get_port: Callable[[], int | None], open_scene: Any) -> None:
    with Web(get_port, lambda _: True) as web:
        answer = web.get("/viser/")
        assert (answer.status_code, answer.text) == (502, "The 3D view is not running.")
        client = open_scene(web.port, "/viser", origin=web.origin)
        with pytest.raises(ConnectionClosed) as closed:
            client.read_present_state()
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1011, "The 3D view is not running.")


def test_when_viser_stops_the_browser_is_told(open_scene: Any) -> None:
    view = ViserView(Params())
    with Web(lambda: view.port, lambda _: True) as web:
        client = open_scene(web.port, "/viser", origin=web.origin)
        client.read_present_state()
        view.close()
        with pytest.raises(ConnectionClosed):
            client.read_until(lambda _: False)


def test_when_the_browser_leaves_viser_is_told(web: Web, view: ViserView, open_scene: Any) -> None:
    gone = threading.Event()
    view._server.on_client_disconnect(lambda _: gone.set())
    client = open_scene(web.port, "/viser", origin=web.origin)
    client.read_present_state()
    client.connection.close()
    assert gone.wait(180)
