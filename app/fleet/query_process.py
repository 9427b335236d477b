"""Runs the queries of pages in a process of their own, ``python -m app.fleet.query_process ADDRESS``, which is ended if
one takes too long.

DuckDB stops a query only between two batches of rows, and one call of a function in a condition can take hours or all
memory: ``length(repeat('a', 2000000000))``.
"""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal

import msgspec

from app.core.pipe_messages import PipeClosed, receive, send
from app.fleet.pack_index import Pack, packs_of
from app.fleet.runs import check_run, latest_run
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from pipeline.common.idle_priority import be_killed_first

if TYPE_CHECKING:
    from app.fleet.find import FleetTables

QueryKind = Literal["find", "histogram", "counts"]
MOST_S = 20.0
"""Time limit of a query."""
_KILLED_AFTER_S = 2.0
"""In addition, if DuckDB does not stop it."""
_OF_A_THREAD = 128 << 20
"""Address space that a thread reserves for its stack and its heap."""


class FleetQuery(msgspec.Struct):
    """A question to the process."""

    run: str | None
    """Name of the run; None: the last batch's."""
    kind: QueryKind
    """Method of ``FleetTables``."""
    arguments: dict[str, Any]
    """Of the method, by name."""
    most_s: float
    """Time limit."""


class FleetReply(msgspec.Struct):
    """Sent twice: when the tables are open, and with the answer."""

    run: str = ""
    """Name of the run."""
    value: Any = None
    """What the method returns; tuples as lists, a ``QueryResult`` by names."""
    error: str = ""
    """Why there is no answer; empty if there is one."""
    is_overloaded: bool = False
    """Whether the error may pass."""


class QueryProcess:
    """The server's side. For one thread at a time, ``close`` from any; after it, the next question starts anew."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, run: str | None, kind: QueryKind, arguments: dict[str, Any], most_s: float = MOST_S) -> FleetReply:
        """The answer to a question about a run. BadInput if it is invalid or takes longer than ``most_s``, counted from
        when the tables are open; Overloaded while a store fails."""
        process = self._running()
        try:
            send(_pipe(process.stdin), FleetQuery(run, kind, arguments, most_s))
            opened = receive(_pipe(process.stdout), FleetReply)
        except (PipeClosed, OSError, ValueError):  # ValueError: the pipe was closed by another thread
            self.close()
            raise Overloaded("the search was ended; try again") from None
        _check(opened)
        too_late = threading.Timer(most_s + _KILLED_AFTER_S, process.kill)
        too_late.start()
        try:
            answer = receive(_pipe(process.stdout), FleetReply)
        except (PipeClosed, OSError, ValueError):
            self.close()
            raise BadInput(f"the search was stopped: it took more than {most_s:g} s, or too much memory") from None
        finally:
            too_late.cancel()
        _check(answer)
        return answer

    def close(self) -> None:
        """End the process, whatever it does."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # a question could not be delivered
                _pipe(stream).close()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self.close()
        if self._process is None:
            self._process = subprocess.Popen(
                (sys.executable, "-m", "app.fleet.query_process", self._address),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process


def _check(reply: FleetReply) -> None:
    if reply.is_overloaded:
        raise Overloaded(reply.error)
    if reply.error:
        raise BadInput(reply.error)


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    assert stream is not None
    return stream


# ------------------------------------------------------------ in the process


def main() -> None:
    """Answer until the server closes the pipe; then end at once, whatever is being computed."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # sent to the whole group; the server decides when this process ends
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    be_killed_first()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints must not get between the answers
    questions: queue.SimpleQueue[FleetQuery] = queue.SimpleQueue()
    threading.Thread(target=_hear, args=(questions,), daemon=True).start()
    tables = _OpenTables(sys.argv[1])
    _limit_memory()
    while True:
        asked = questions.get()
        opened, reply = _said(lambda asked=asked: tables.of(asked.run, asked.most_s))
        send(answers, reply)
        if opened is not None:
            value, reply = _said(lambda asked=asked, opened=opened: getattr(opened, asked.kind)(**asked.arguments))
            send(answers, msgspec.structs.replace(reply, run=opened.run, value=value))


def _limit_memory() -> None:
    """Of address space, in addition to what the libraries take: DuckDB's own limit does not count what functions
    return. Threads reserve a part of it."""
    from app.fleet.find import MOST_BYTES

    with suppress(ImportError, OSError, ValueError):  # not on every system
        import resource

        size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        most = size + 2 * MOST_BYTES + (os.cpu_count() or 1) * _OF_A_THREAD
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _hear(questions: queue.SimpleQueue[FleetQuery]) -> None:
    with suppress(PipeClosed):
        while True:
            questions.put(receive(sys.stdin.buffer, FleetQuery))
    os._exit(0)


def _said(work: Any) -> tuple[Any, FleetReply]:
    """The result of some work, and the reply if it fails."""
    try:
        return work(), FleetReply()
    except Overloaded as error:
        return None, FleetReply(error=str(error), is_overloaded=True)
    except BadInput as error:
        return None, FleetReply(error=str(error))
    except MemoryError:
        return None, FleetReply(error="the search took too much memory")


class _OpenTables:
    """The tables of the run that was asked for last, opened anew when a batch has added to them."""

    def __init__(self, address: str) -> None:
        self._store = Store(address)
        self._open: tuple[str, list[Pack], float, FleetTables] | None = None

    def of(self, run: str | None, most_s: float) -> FleetTables:
        from app.fleet.find import FleetTables  # DuckDB takes a moment to import

        name = run or latest_run(self._store)
        if self._open is None or self._open[0] != name:
            check_run(self._store, name)
        packs = packs_of(self._store, name)
        if self._open is None or self._open[:3] != (name, packs, most_s):
            self._open = name, packs, most_s, FleetTables(self._store, name, most_s)
        return self._open[3]


if __name__ == "__main__":
    main()
