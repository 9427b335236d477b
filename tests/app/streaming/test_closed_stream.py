"""What a server leaves behind when it is closed: no thread, and nothing that is still computed."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import nullcontext

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from websockets.sync.client import connect

from app.engine.page_frames import PageFrame, PageFrames
from app.engine.snapshot import Snapshot
from app.streaming.stream import Stream
from app.web.server import create_app
from pipeline.params import Params
from tests.app.web.serving import WAIT_S, running, serving


class Endless(PageFrames):
    """A frame that takes until nobody wants it."""

    def __init__(self) -> None:
        super().__init__(nullcontext)
        self.began: list[int] = []
        self.is_begun, self.is_given_up = threading.Event(), threading.Event()

    def make(self, index: int, params: Params, superseded: Callable[[], bool], *, at_once: bool) -> PageFrame | None:
        self.began.append(index)
        self.is_begun.set()
        while not superseded():
            self.is_given_up.wait(0.01)
        self.is_given_up.set()
        return None


def test_the_threads_of_a_closed_server_end():
    before = set(threading.enumerate())
    with running() as engine:
        app = create_app(engine)
        with serving(app) as address:
            stream = address.replace("http", "ws") + "/api/stream"
            with connect(f"{stream}?own=1") as own, connect(stream) as shared:
                own.recv(WAIT_S)
                shared.recv(WAIT_S)
                made = _makers() - before
                assert made, "somebody makes their frames"
        for thread in made:
            thread.join(WAIT_S)
        assert not made & set(threading.enumerate())
    assert app.title  # it still exists: the threads did not end because it was collected


def test_a_closed_stream_gives_up_the_frame_of_a_page_and_makes_no_other():
    frames = Endless()
    stream = Stream(frames=frames)
    stream.publish(Snapshot(Params(), count=9))
    app = Starlette(routes=[WebSocketRoute("/", stream.serve)])
    with serving(app) as address, connect(f"{address.replace('http', 'ws')}/?own=1") as page:  # type: ignore[arg-type]
        assert frames.is_begun.wait(WAIT_S)
        stream.close()
        assert frames.is_given_up.wait(WAIT_S)
        page.send(json.dumps({"own": 2}))
        page.send(json.dumps({"ping": 1.0}))
        while json.loads(page.recv(WAIT_S))["type"] != "pong":  # by then, what was sent before has been heard
            pass
    assert frames.began == [1]


def _makers() -> set[threading.Thread]:
    return {thread for thread in threading.enumerate() if thread.name.startswith(("cipv-stream", "cipv-pages"))}
