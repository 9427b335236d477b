"""Misbehaving clients of a server in a chaos soak, and other programs that take the machine."""

from __future__ import annotations

import contextlib
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

from websockets.sync.client import connect

from tests.soak.chaos.server import LabelledServer


def half_open(server: LabelledServer, stop: threading.Event) -> None:
    """A client that never completes its requests, and one that sends garbage."""
    held: list[socket.socket] = []
    while not stop.wait(0.05):
        parts = urlsplit(server.address)
        with contextlib.suppress(OSError):
            held.append(socket.create_connection((parts.hostname or "", parts.port or 0), timeout=2.0))
            held[-1].sendall(random.choice([b"GET / HTTP/1.1\r\nX:", random.randbytes(64), b""]))
            server.figures.clients += 1
        while len(held) > 150:
            held.pop(0).close()
    for each in held:
        each.close()


def deaf(server: LabelledServer, stop: threading.Event) -> None:
    """Clients of the stream that never read, and send garbage."""
    while not stop.is_set():
        with (
            contextlib.suppress(Exception),
            connect(server.address.replace("http", "ws") + "/api/stream", max_queue=1) as stream,
        ):
            server.figures.clients += 1
            for _ in range(50):
                stream.send(random.choice(["{}", "null", '{"seek": 1e999}', random.randbytes(200), "[" * 5000]))
                if stop.wait(0.1):
                    break
        stop.wait(0.2)


@contextmanager
def pressure() -> Iterator[None]:
    """Run other programs: one that uses a processor, and one that uses memory."""
    hungry = "import time; held = bytearray(300 << 20); held[::4096] = b'x' * len(held[::4096]); time.sleep(600)"
    commands = [[sys.executable, "-c", text] for text in ("while True: pass", hungry)]
    processes = [subprocess.Popen(command) for command in commands]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
