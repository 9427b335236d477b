"""Recordings listed in the page's source menu: the simulator's scenarios, sessions and known data folders."""

from __future__ import annotations

from pathlib import Path

from app.core.session_folder import SESSIONS
from pipeline.common.files.data_dir import data_dir
from pipeline.source_kinds import built_in, looks_like


def catalog() -> list[tuple[str, str]]:
    """(uri, title) pairs: scenarios, then sessions, then the recordings right below ``CIPV_DATA`` and ``sessions``."""
    return [*built_in(), *sessions(), *recordings()]


def sessions(folder: Path = SESSIONS) -> list[tuple[str, str]]:
    """(uri, title) of the sessions on this machine, newest first."""
    files = (
        sorted(folder.glob("*.mcap"), key=lambda file: (-file.stat().st_mtime, file.name)) if folder.is_dir() else ()
    )
    return [(str(file), f"session · {file.stem}") for file in files]


def recordings() -> list[tuple[str, str]]:
    """(uri, title) of entries directly below the data folder and ``sessions`` that look like a known recording."""
    found = []
    for root in (data_dir(), SESSIONS):
        for path in sorted(root.iterdir()) if root.is_dir() else ():
            scheme = looks_like(path)
            if scheme is not None:
                title = path.name if path.name.startswith(scheme) else f"{scheme} · {path.name}"
                found.append((f"{scheme}:{path}", title))
    return found
