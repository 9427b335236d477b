"""Where the program keeps what it needs again: networks, their settings for this machine, compiled kernels.

Imported before numba, and therefore without it.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

HOME_VARIABLE = "CIPV_HOME"
_NUMBA_VARIABLE = "NUMBA_CACHE_DIR"


def own_folder() -> Path:
    """``CIPV_HOME``, or ``~/.cache/cipv``; it need not exist. For an account without a home, as of a service,
    ``private_folder``."""
    named = os.environ.get(HOME_VARIABLE)
    if named:
        return Path(named)
    try:
        return Path.home() / ".cache" / "cipv"
    except RuntimeError:  # no HOME, and no entry for the account
        return private_folder()


def why_impossible(folder: Path) -> str | None:
    """Why a folder below ``own_folder`` cannot be created, as a sentence with the remedy: a part of its path is a file.
    None if it exists or nothing is known to prevent it; permissions show when something is written."""
    blocking = next((each for each in (folder, *folder.parents) if os.path.lexists(each)), None)
    if blocking is None or blocking.is_dir():
        return None
    reason = f"{own_folder()} cannot be created, since {blocking} is not a folder"
    named = os.environ.get(HOME_VARIABLE)
    return f"{HOME_VARIABLE}: {reason}" if named else f"{reason}; set {HOME_VARIABLE} to a folder for networks"


def place_compiled_kernels(source: Path) -> None:
    """Let numba keep compiled kernels where that is possible. By itself it tries only the folder of the source, which
    may be read-only, and the account's home, which may be missing, and then refuses to start.

    source: a folder with kernels.
    """
    if os.environ.get(_NUMBA_VARIABLE) or _is_writable(source / "__pycache__"):
        return
    folder = own_folder() / "kernels"
    os.environ[_NUMBA_VARIABLE] = str(folder if _is_writable(folder) else private_folder() / "kernels")


def private_folder() -> Path:
    """A folder among the temporary files that nobody else can write to, since compiled kernels are code: the account's
    usual one, or a new one if that name is somebody else's."""
    account = os.getuid() if hasattr(os, "getuid") else 0
    usual = Path(tempfile.gettempdir()) / f"cipv-{account}"
    try:
        usual.mkdir(mode=0o700, exist_ok=True)
        found = usual.lstat()
    except OSError:
        return Path(tempfile.mkdtemp(prefix="cipv-"))
    is_own = stat.S_ISDIR(found.st_mode) and (not hasattr(os, "getuid") or found.st_uid == account)
    is_closed = not hasattr(os, "getuid") or not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return usual if is_own and is_closed else Path(tempfile.mkdtemp(prefix="cipv-"))


def _is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
