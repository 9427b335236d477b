"""A server with only the stream, and what its clients send and receive."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from websockets.sync.client import ClientConnection, connect

from app.core.detection_cache import DetectionCache
from app.core.server_address import listen_socket
from app.engine.page_frames import PageFrames
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from app.streaming.stream import Stream
from app.web.server import Server
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.types import CameraImage
from tests.app.engine.recording_helpers import CountingDetector, Recording

WAIT_S = 180.0


@dataclass
class Site:
    """A server with only the stream; ``show(n)`` publishes frame n, as an engine's thread does."""

    stream: Stream
    port: int
    first: Snapshot
    pauses: list[bool] = field(default_factory=list)
    """One entry for each time that the stream paused playback."""

    def show(self, sequence: int, **changes: Any) -> None:
        self.stream.publish(replace(self.first, sequence=sequence, index=sequence, **changes))

    def connected(self, query: str = "") -> AbstractContextManager[ClientConnection]:
        """A client with a small receive buffer and a short closing timeout."""
        end = socket.socket()
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        end.connect(("127.0.0.1", self.port))
        url = f"ws://127.0.0.1:{self.port}/{query}"
        patience = {"open_timeout": WAIT_S, "close_timeout": 0.5}
        return connect(url, sock=end, max_size=None, compression=None, max_queue=1, **patience)


@contextmanager
def serving() -> Iterator[Site]:
    """Runs until the end of the block."""
    frames = PageFrames(nullcontext)
    frames.open(_pipeline())
    pauses: list[bool] = []
    stream = Stream(frames=frames, pause=lambda: pauses.append(True))
    bound, is_ready = listen_socket("127.0.0.1", 0), threading.Event()
    app = Starlette(routes=[WebSocketRoute("/", stream.serve)])
    server = Server(app, "http://ready", lambda _: is_ready.set())  # type: ignore[arg-type]
    thread = threading.Thread(target=lambda: server.run(sockets=[bound]))
    thread.start()
    assert is_ready.wait(WAIT_S)
    site = Site(stream, bound.getsockname()[1], _first(), pauses)
    site.show(0)
    yield site
    server.should_exit = True
    thread.join()


def _first() -> Snapshot:
    """A frame with a noise image wider than any page needs, whose JPEG is large."""
    pipeline = _pipeline()
    tick = pipeline.seek(0, Params())
    assert tick is not None
    noise = np.random.default_rng(0).integers(0, 255, (900, 2560, 3), np.uint8)
    tick = replace(tick, frame=replace(tick.frame, image=CameraImage(0, noise)))
    return Snapshot(Params(), uri=pipeline.source.uri, count=1, processed=tick)


def _pipeline() -> SeekablePipeline:
    return SeekablePipeline(Recording(), Detectors(CountingDetector(), None), DetectionCache(), "both")


def next_header(client: ClientConnection) -> dict[str, Any]:
    while True:
        message = client.recv(WAIT_S)
        if isinstance(message, bytes):
            (length,) = struct.unpack_from("<I", message)
            return json.loads(message[4 : 4 + length])


def header_where(client: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while not wanted(header := next_header(client)):
        pass
    return header


def sequence_of(header: dict[str, Any]) -> int:
    return int(header["state"]["sequence"])


def go_to(client: ClientConnection, index: int) -> None:
    client.send(json.dumps({"own": index}))
    header_where(client, lambda header: index_of(header) == index)


def texts(client: ClientConnection) -> Iterator[dict[str, Any]]:
    while True:
        if isinstance(message := client.recv(WAIT_S), str):
            yield json.loads(message)


def heard(client: ClientConnection) -> None:
    """Wait until the server has read everything sent so far."""
    client.send(json.dumps({"ping": 1}))
    while isinstance(message := client.recv(WAIT_S), bytes) or json.loads(message)["type"] != "pong":
        pass


def index_of(header: dict[str, Any]) -> int:
    return int(header["state"]["index"])
