"""Where recordings and networks that are not part of the program are kept."""

from __future__ import annotations

import os
from pathlib import Path

_PROJECT = Path(__file__).resolve().parent.parent


def data_dir() -> Path:
    """``$CIPV_DATA``; without the variable, the folder ``shared/data`` beside the project. It need not exist."""
    named = os.environ.get("CIPV_DATA")
    return Path(named) if named else _PROJECT.parent / "shared" / "data"
