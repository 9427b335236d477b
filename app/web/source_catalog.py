"""Recordings listed in the page's source menu: the simulator's scenarios, sessions and known data folders."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from app.core.session_folder import SESSIONS
from pipeline.common.files.data_dir import data_dir
from pipeline.source_kinds import built_in, looks_like

_FOLDERS_BETWEEN = 2
_MOST_ENTRIES, _MOST_DRIVES = 1000, 100
"""Looked at altogether, and in a folder that is a recording or holds several: a folder of another kind may have any
number of files, and the list is asked for often."""


def catalog() -> list[tuple[str, str]]:
    """(uri, title) pairs: scenarios, then sessions, then the recordings below ``CIPV_DATA`` and ``sessions``."""
    return [*built_in(), *sessions(), *recordings()]


def sessions(folder: Path = SESSIONS) -> list[tuple[str, str]]:
    """(uri, title) of the sessions on this machine, newest first."""
    files = (
        sorted(folder.glob("*.mcap"), key=lambda file: (-file.stat().st_mtime, file.name)) if folder.is_dir() else ()
    )
    return [(str(file), f"session · {file.stem}") for file in files]


def recordings() -> list[tuple[str, str]]:
    """(uri, title) of entries below the data folder and ``sessions`` that look like a known recording: directly below,
    or in folders in between, such as KITTI's ``DATE/DRIVE``."""
    found = []
    for root in (data_dir(), SESSIONS):
        for scheme, path in _recordings_in(root):
            title = path.name if path.name.startswith(scheme) else f"{scheme} · {path.name}"
            found.append((f"{scheme}:{path}", title))
    return found


def _recordings_in(root: Path) -> Iterator[tuple[str, Path]]:
    """Scheme and path of each recording, those in the fewest folders first. Of a folder of drives of one kind, each
    drive."""
    folders, left = deque([(root, 0)]), _MOST_ENTRIES
    while folders and left > 0:
        folder, depth = folders.popleft()
        entries = _entries(folder, left)
        left -= len(entries)
        for path in entries:
            scheme = looks_like(path)
            if scheme is not None:
                drives = [each for each in _entries(path, _MOST_DRIVES) if each.is_dir() and looks_like(each) == scheme]
                yield from ((scheme, each) for each in drives or [path])
            elif depth < _FOLDERS_BETWEEN and path.is_dir() and not path.is_symlink():
                folders.append((path, depth + 1))


def _entries(folder: Path, most: int) -> list[Path]:
    """By name; of a large folder only some; none of what is no folder or cannot be read."""
    try:
        with os.scandir(folder) as found:
            return sorted(folder / each.name for each in islice(found, most))
    except OSError:
        return []
