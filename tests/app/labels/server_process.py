"""A real server in a process of its own, which can be killed at any moment."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from app.core.server_address import listen_socket
from app.engine.engine import Engine
from app.labels.service.desk import LabelDesk
from app.labels.store.database import Database
from app.web.server import Server, create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.web.serving import WAIT_S


def _serve(file: Path | str, tell: Connection, ahead_s: Any) -> None:
    if ahead_s is not None:
        _set_clock(ahead_s)
    recording = Recording()
    engine = Engine(
        opener(recording),
        None,
        Params(),
        uri=recording.uri,
        whole_drives=True,
        labels=LabelDesk(Database.in_file(file) if isinstance(file, Path) else Database(file)),
    )
    engine.start()
    engine.wait_for(lambda shown: shown.labels.labelled, WAIT_S)
    bound = listen_socket("127.0.0.1", 0)
    address = f"http://127.0.0.1:{bound.getsockname()[1]}"
    Server(create_app(engine), address, tell.send).run(sockets=[bound])


@contextmanager
def forking() -> Iterator[ForkServerContext]:
    """The process that forks servers."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.app.labels.preloaded"])
    yield context


def _set_clock(ahead_s: Any) -> None:
    """Let this process see the system clock ahead by a value that may change."""
    seconds, nanoseconds = time.time, time.time_ns
    time.time = lambda: seconds() + ahead_s.value
    time.time_ns = lambda: nanoseconds() + round(ahead_s.value * 1e9)


def started(context: ForkServerContext, file: Path | str, ahead_s: Any = None) -> tuple[BaseProcess, str]:
    """The process and its address, as soon as it answers. file: of SQLite, or a database's address. ahead_s: shared
    value, by which the process's clock is ahead."""
    hear, tell = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(file, tell, ahead_s), daemon=True)
    process.start()
    assert hear.poll(WAIT_S), "the server does not start"
    address: str = hear.recv()
    hear.close()
    tell.close()
    return process, address
