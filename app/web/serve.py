"""Runs the server and the engine as one program, until it is asked to stop.

The engine starts before FastAPI is imported, which takes half a second: meanwhile it opens the recording and produces
the first image.
"""

from __future__ import annotations

import socket
import sys
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from app.core.server_address import DEFAULT_PORT, is_loopback, listen_socket, reachable
from app.core.session_folder import SESSIONS
from app.core.shared_view_state import SharedViewState
from app.core.stop_signals import SAVE_S, asked_to_stop, end_process_once
from app.drive.alignment_versions import AlignmentVersions
from app.drive.marks import Marks
from app.engine.engine import Engine
from app.fleet.desk import FleetDesk
from app.web.guards.accounts import Accounts
from app.web.guards.tokens import Tokens
from pipeline.common.garbage_collection import freeze_loaded_objects


def serve(
    engine: Engine,
    *,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    strict_port: bool = False,
    hosts: Iterable[str] = (),
    viser_port: Callable[[], int | None] = lambda: None,
    looks: SharedViewState | None = None,
    on_ready: Callable[[str], None] | None = None,
    always_token: bool = False,
    tls: tuple[Path, Path] | None = None,
    ends_process: bool = False,
    fleet: FleetDesk | None = None,
) -> None:
    """Serve until Ctrl-C, SIGTERM or SIGHUP. Starts and stops the engine; once it responds, prints the page's address
    on its own line, and links with tokens if other machines can connect.

    hosts: names by which a proxy on this machine asks. always_token: require tokens even if only this machine can
    connect, since its other users could do everything otherwise. tls: files of a certificate and its key. fleet: the
    tables that the Fleet view searches. ends_process: the process does nothing else, and ends even if some of its work
    hangs.

    PortTaken and BadInput (a weak token, unreadable accounts, no certificate) are raised before anything is started.
    """
    hosts = tuple(hosts)
    is_private = is_loopback(host) and not hosts and not always_token
    tokens = None if is_private else Tokens.from_environment(accounts=Accounts())
    bound = listen_socket(host, port, strict=strict_port)
    number = bound.getsockname()[1]
    if port not in (0, number):
        print(f"cipv: port {port} is in use; using {number}", file=sys.stderr)
    address = f"{'http' if tls is None else 'https'}://{reachable(host)}:{number}"
    # two servers on one machine have separate parameters
    engine.labels.kept.station = f"{socket.gethostname()}:{number}"
    # FastAPI suppresses this warning for its own use of pydantic, but a thread that suppresses another warning at the
    # same time undoes that
    warnings.filterwarnings("ignore", message="The 'alias' attribute with value")
    with asked_to_stop() as asked:
        if ends_process:
            end_process_once(asked, partial(engine.recorder.stop, SAVE_S))
        engine.start()
        try:
            from app.web.server import Server, create_app
            from app.web.tls_files import TlsFiles

            context = TlsFiles(*tls).context() if tls is not None else None
            marks, audit = Marks(SESSIONS / "marks"), SESSIONS / "audit.jsonl"
            alignments = AlignmentVersions(SESSIONS / "alignments.json")
            app = create_app(engine, viser_port, (*hosts, host), marks, looks, tokens, audit, alignments, fleet)
            freeze_loaded_objects("server")
            Server(app, address, on_ready, tokens, asked, context, bool(hosts)).run(sockets=[bound])
        finally:
            engine.stop()
            bound.close()
