"""Whether a recording is still the one that was opened before under the same name."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qsl


def fingerprint(uri: str) -> str:
    """Sixteen characters that are another when a file of the recording was edited or replaced: by the name, size and
    time of change of the file and of what shares its stem (a video, sentences), of all files of a folder, and of files
    named in options. A URI that names no file, as of a built-in scenario, stays as it is."""
    _, _, rest = uri.partition(":")
    digest = hashlib.sha256(uri.encode(errors="replace"))
    for file in _files(rest) if rest else _files(uri):
        try:
            stat = file.stat()
        except (OSError, ValueError):
            continue
        digest.update(f"{file}\0{stat.st_size}\0{stat.st_mtime_ns}\0{stat.st_ino}\0".encode(errors="replace"))
    return digest.hexdigest()[:16]


def _files(rest: str) -> Iterator[Path]:
    """What the part after the scheme names, in a fixed order."""
    path, _, query = rest.partition("?")
    try:
        main = Path(path).expanduser()
        if main.is_dir():
            yield from _below(main)
        elif main.is_file():
            yield from sorted(each for each in main.parent.iterdir() if each.name.startswith(main.stem))
        for _, value in parse_qsl(query):
            yield main.parent / Path(value).expanduser()
            yield main / Path(value).expanduser()
    except (OSError, RuntimeError, ValueError):  # what cannot be read is for who opens it to say
        return


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            yield Path(parent, name)
