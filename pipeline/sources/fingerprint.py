"""Determines whether a recording is unchanged since it was last opened, and whether two recordings are the same."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import parse_qsl

import numpy as np

from pipeline.common.remote_files import facts, is_remote, version_of
from pipeline.types import Frame


def fingerprint(uri: str) -> str:
    """Sixteen characters that are another when a file of the recording was edited or replaced: by the name, size and
    time of change of the file and of what shares its stem (a video, sentences), of all files of a folder, and of files
    named in options; of a file in a store by its size and what the store says of its version. A URI that names no file,
    as of a built-in scenario, stays as it is."""
    _, _, rest = uri.partition(":")
    digest = hashlib.sha256(uri.encode(errors="replace"))
    if is_remote(uri):
        digest.update(version_of(facts(uri)).encode())
        return digest.hexdigest()[:16]
    for file in _files(rest) if rest else _files(uri):
        try:
            stat = file.stat()
        except (OSError, ValueError):
            continue
        digest.update(f"{file}\0{stat.st_size}\0{stat.st_mtime_ns}\0{stat.st_ino}\0".encode(errors="replace"))
    return digest.hexdigest()[:16]


def content_key(t_ns: Sequence[int], frame: Callable[[int], Frame]) -> str:
    """Sixteen characters of what is in a recording, wherever it lies and whatever form it has: a session that was made
    of it has the same, and so has one whose LiDAR was found to be mounted otherwise, or beside which a video was put.
    From the ticks of all frames, and what the sensor sent in the first, the middle and the last one."""
    digest = hashlib.sha256(np.array(t_ns, np.int64).tobytes())
    for index in sorted({0, len(t_ns) // 2, len(t_ns) - 1}) if t_ns else ():
        digest.update(_as_sent(frame(index)))
    return digest.hexdigest()[:16]


def _as_sent(frame: Frame) -> bytes:
    """The intensities of a sweep, which no mount changes; where there are none the image, or else the places."""
    intensity = frame.sweep.points[:, 3] if frame.sweep is not None else np.empty(0)
    if (intensity != intensity[:1]).any():
        return intensity.tobytes()
    if frame.image is not None:
        return frame.image.encoded or np.ascontiguousarray(frame.image.bgr).tobytes()
    return np.ascontiguousarray(frame.sweep.points).tobytes() if frame.sweep is not None else b""


def _files(rest: str) -> Iterator[Path]:
    """What the part after the scheme names, in a fixed order."""
    path, _, query = rest.partition("?")
    if not path:
        return
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
