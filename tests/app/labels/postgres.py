"""A PostgreSQL of the tests' own: a cluster in a temporary folder, reached by a socket in it, gone at the end."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import create_engine, text

_USERS = ("postgres", "nobody")
"""Root is not allowed to run it."""
_PATIENCE_S = 60


def binaries() -> Path | None:
    """The newest folder with ``initdb`` and ``pg_ctl``; None without one."""
    on_path = shutil.which("initdb")
    if on_path is not None:
        return Path(on_path).parent
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    return found[-1].parent if found else None


@contextmanager
def running(folder_of_binaries: Path) -> Iterator[str]:
    """The address of a running server."""
    folder = Path(tempfile.mkdtemp(prefix="cipv-pg-"))
    user = _somebody() if os.geteuid() == 0 else None
    if user is not None:
        os.chown(folder, user, -1)

    def call(program: str, *arguments: str) -> None:
        done = subprocess.run(
            [str(folder_of_binaries / program), "-D", str(folder / "data"), *arguments],
            user=user,
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
        )
        assert done.returncode == 0, done.stdout + done.stderr

    try:
        call("initdb", "-U", "tester", "-A", "trust", "-E", "UTF8", "--no-locale", "--no-sync")
        options = f"-k {folder} -c listen_addresses='' -c fsync=off"
        call("pg_ctl", "-w", "-l", str(folder / "log"), "-o", options, "start")
        try:
            yield f"postgresql://tester@/postgres?host={folder}"
        finally:
            call("pg_ctl", "-w", "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def new_database(server: str, name: str) -> str:
    """The address of a new database of the server."""
    engine = create_engine(server.replace("postgresql:", "postgresql+psycopg:"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return server.replace("/postgres?", f"/{name}?")


def _somebody() -> int:
    names = {each.pw_name: each.pw_uid for each in pwd.getpwall()}
    return next(names[name] for name in _USERS if name in names)
