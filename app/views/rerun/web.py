"""rerun's own web viewer, served by this program.

The wheel installs a ``rerun`` program that contains the viewer and serves it on every interface. It is therefore
started once, on loopback; its two files are copied, and it is stopped. It runs with a temporary home folder and
``CI=true``, so it sends no usage data and leaves the user's settings unchanged.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import IO

from app.core.local_requests import open_local
from pipeline.common.errors import BadInput

FILES = ("re_viewer.js", "re_viewer_bg.wasm")
_START_S = 20.0
_POLL_S = 0.1
_READ_S = 30.0
_BLOCK = 1 << 20


class NoViewer(BadInput):
    """This installation has no web viewer; the message gives the reason."""


class ViewerFiles:
    """The viewer's files, fetched when first requested. Thread-safe. ``close`` removes them."""

    def __init__(self, program: Path | None = None) -> None:
        self._program = program
        self._lock = threading.Lock()
        self._folder: Path | None = None

    def path(self, name: str) -> Path:
        """The path of one of ``FILES``. NoViewer if the viewer is not available."""
        if name not in FILES:
            raise NoViewer(f"the viewer has no file {name}")
        with self._lock:
            if self._folder is None:
                self._folder = _fetch(self._program or _installed())
            return self._folder / name

    def close(self) -> None:
        """Remove the files."""
        with self._lock:
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)
                self._folder = None


def _installed() -> Path:
    """Path of the program itself, not of the wrapper script around it."""
    package = importlib.util.find_spec("rerun_cli")
    folders = package.submodule_search_locations if package is not None else None
    for folder in folders or ():
        for name in ("rerun", "rerun.exe"):
            if (Path(folder) / name).is_file():
                return Path(folder) / name
    raise NoViewer("the rerun program is not installed with its Python package")


def _fetch(program: Path) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="cipv-rerun-"))
    try:
        _fetch_into(program, folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _fetch_into(program: Path, folder: Path) -> None:
    port, grpc_port = free_ports(2)
    command = [str(program), "--serve-web", "--bind", "127.0.0.1"]
    command += ["--port", str(grpc_port), "--web-viewer-port", str(port)]
    home = folder / "home"
    home.mkdir()
    environment = {"HOME": str(home), "USERPROFILE": str(home), "CI": "true", "PATH": os.environ.get("PATH", "")}
    try:
        server = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
    except OSError as error:
        raise NoViewer(f"{program}: the rerun program cannot be started: {error.strerror}") from None
    try:
        _wait_for(server, port)
        for name in FILES:
            with _get(port, name) as response, (folder / name).open("wb") as file:
                shutil.copyfileobj(response, file, _BLOCK)
    except OSError as error:
        raise NoViewer(f"the rerun program did not serve its web viewer: {error}") from None
    finally:
        server.kill()
        server.wait()
        shutil.rmtree(home, ignore_errors=True)


def _wait_for(server: subprocess.Popen[bytes], port: int) -> None:
    ends_s = time.monotonic() + _START_S
    while True:
        try:
            _get(port, "").close()
        except OSError:
            if server.poll() is not None:
                raise NoViewer("the rerun program ended without serving its web viewer") from None
            if time.monotonic() > ends_s:
                raise NoViewer("the rerun program does not serve its web viewer") from None
            time.sleep(_POLL_S)
        else:
            return


def _get(port: int, name: str) -> IO[bytes]:
    """An open response from the program."""
    return open_local(f"http://127.0.0.1:{port}/{name}", _READ_S)


def free_ports(count: int) -> list[int]:
    """Free ports on loopback."""
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports
