"""Files that a command writes at its end."""

from __future__ import annotations

from pathlib import Path


def ensure_writable(file: Path) -> None:
    """Report a file that cannot be written before the work, not after it. Its folder is created; a file that does not
    exist is not left behind, so that work that fails later leaves no empty one.

    Raises:
        OSError: the file cannot be written.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    is_new = not file.exists()
    file.open("a").close()
    if is_new:
        file.unlink()
