"""A real server in a process of its own, which can be killed at any moment."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest

from app.core.server_address import listen_socket
from app.engine.engine import Engine
from app.labels.service.desk import LabelDesk
from app.labels.store.database import Database
from app.web.server import Server, create_app
from pipeline.params import Params
from pipeline.sources import open_any
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.web.serving import WAIT_S


def _serve(file: Path | str, tell: Connection, ahead_s: Any, session: Path | None) -> None:
    if ahead_s is not None:
        set_clock(pytest.MonkeyPatch(), lambda: ahead_s.value)
    recording = Recording()
    engine = Engine(
        opener(recording) if session is None else open_any,
        None,
        Params(),
        uri=recording.uri if session is None else str(session),
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


def set_clock(patch: pytest.MonkeyPatch, ahead_s: Callable[[], float]) -> None:
    """Let this process see the system clock ahead by a number of seconds that may change."""
    seconds, nanoseconds = time.time, time.time_ns
    patch.setattr(time, "time", lambda: seconds() + ahead_s())
    patch.setattr(time, "time_ns", lambda: nanoseconds() + round(ahead_s() * 1e9))


def started(
    context: ForkServerContext, file: Path | str, ahead_s: Any = None, session: Path | None = None
) -> tuple[BaseProcess, str]:
    """The process and its address, as soon as it answers. file: of SQLite, or a database's address. ahead_s: shared
    value, by which the process's clock is ahead. session: what it has opened; None for a recording in memory."""
    hear, tell = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(file, tell, ahead_s, session), daemon=True)
    process.start()
    assert hear.poll(WAIT_S), "the server does not start"
    address: str = hear.recv()
    hear.close()
    tell.close()
    return process, address
