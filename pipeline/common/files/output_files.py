"""Files that a user names for output, and what happens to one that exists already.

What can be opened again is never overwritten, since a person may have recorded, measured or edited it: recordings,
labels, calibrations, presets, settings and keys. Results and reports, which the same command writes again, are
replaced: JSON lines, rerun recordings, tables and HTML.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, Literal

from pipeline.common.errors import BadInput


def ensure_new(file: Path) -> None:
    """Report a file that exists before the work, not after it. BadInput if it does."""
    if file.exists():
        raise _exists(file)


def open_new(file: Path, mode: Literal["xb", "x+b"] = "xb", buffering: int = -1) -> BinaryIO:
    """A new file, open for writing, or for both with ``x+b``. BadInput if it exists."""
    try:
        return open(file, mode, buffering)
    except FileExistsError:
        raise _exists(file) from None


def write_new(file: Path, text: str) -> None:
    """Write a new UTF-8 text file. BadInput if it exists."""
    with open_new(file) as opened:
        opened.write(text.encode("utf-8"))


def write_new_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write UTF-8 text files by name into a folder, which is created if it does not exist: all of them, or none and
    BadInput if one exists."""
    if folder.exists() and not folder.is_dir():
        raise _exists(folder)
    for name in texts:
        ensure_new(folder / name)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_new(folder / name, text)


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


def _exists(file: Path) -> BadInput:
    return BadInput(f"{file}: file already exists; choose another name or remove it")
