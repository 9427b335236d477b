"""The folder with recordings and networks that do not ship with the program."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

_PROJECT = Path(__file__).resolve().parents[3]


def data_dir() -> Path:
    """``$CIPV_DATA``, or else the folder ``shared/data`` beside the project. The folder need not exist."""
    named = os.environ.get("CIPV_DATA")
    return Path(named) if named else _PROJECT.parent / "shared" / "data"


def file_sha256(path: Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
