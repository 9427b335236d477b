"""A running engine and a real server, as context managers."""

from __future__ import annotations

import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fastapi import FastAPI

from app.core.server_address import listen_socket
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.web.server import Server
from pipeline.params import Params
from pipeline.types.source import Source
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener

WAIT_S = 180.0


@contextmanager
def running(
    desk: SessionRecorder | None = None, *, whole_drives: bool = False, source: Source | None = None
) -> Iterator[Engine]:
    """An engine that shows the first frame of a synthetic recording, or of ``source``."""
    recording = source if source is not None else Recording()
    engine = Engine(
        opener(recording),
        lambda _: CountingDetector(),
        Params(),
        uri=recording.uri,
        recorder=desk,
        whole_drives=whole_drives,
    )
    engine.start()
    try:
        engine.wait_for(lambda shown: shown.processed is not None, WAIT_S)
        yield engine
    finally:
        engine.stop()


@contextmanager
def serving(app: FastAPI, tls: ssl.SSLContext | None = None) -> Iterator[str]:
    """The address of the app, once it responds there."""
    bound, is_ready = listen_socket("127.0.0.1", 0), threading.Event()
    address = f"{'http' if tls is None else 'https'}://127.0.0.1:{bound.getsockname()[1]}"
    server = Server(app, address, lambda _: is_ready.set(), tls=tls)
    thread = threading.Thread(target=lambda: server.run(sockets=[bound]))
    thread.start()
    assert is_ready.wait(WAIT_S)
    try:
        yield address
    finally:
        server.should_exit = True
        thread.join()
        bound.close()


def certificate(folder: Path) -> tuple[Path, Path]:
    """A new certificate of 127.0.0.1, and its key."""
    cert, key = folder / "cert.pem", folder / "key.pem"
    make = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1"]
    named = ["-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run([*make, *named, "-keyout", str(key), "-out", str(cert)], check=True, capture_output=True)
    return cert, key
