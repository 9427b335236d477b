"""Determines whether a recording is unchanged since it was last opened, and whether two recordings are the same."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import parse_qsl

import numpy as np

from pipeline.common.files.remote_files import facts, is_remote, version_of
from pipeline.sources.uri_options import path_and_options
from pipeline.types import Frame


def fingerprint(uri: str) -> str:
    """Sixteen characters that change if a file of the recording is edited or replaced. Based on the name, size and
    modification time of the file and of files with the same stem (video, NMEA), of all files of a folder, of files
    named in options, and of those that an OpenSCENARIO file refers to; for a file in a store, on its size and version.
    A URI without a file, such as a built-in scenario, is returned unchanged."""
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
    """Sixteen characters that identify the content of a recording, independent of its location and format: a session
    recorded from it has the same key, and the key does not change with the LiDAR's mount or a video added beside it.
    Based on the ticks of all frames, and the sensor data of the first, middle and last one."""
    digest = hashlib.sha256(np.array(t_ns, np.int64).tobytes())
    for index in sorted({0, len(t_ns) // 2, len(t_ns) - 1}) if t_ns else ():
        digest.update(_as_sent(frame(index)))
    return digest.hexdigest()[:16]


def _as_sent(frame: Frame) -> bytes:
    """The intensities of a sweep, which do not depend on the mount; without intensities the image, else the
    positions."""
    intensity = frame.sweep.points[:, 3] if frame.sweep is not None else np.empty(0)
    if (intensity != intensity[:1]).any():
        return intensity.tobytes()
    if frame.image is not None:
        return frame.image.encoded or np.ascontiguousarray(frame.image.bgr).tobytes()
    return np.ascontiguousarray(frame.sweep.points).tobytes() if frame.sweep is not None else b""


def _files(rest: str) -> Iterator[Path]:
    """The files named by the part after the scheme, in a fixed order."""
    path, query = path_and_options(rest)
    if not path:
        return
    try:
        main = Path(path).expanduser()
        if main.is_dir():
            yield from _below(main)
        elif main.is_file():
            yield from sorted(each for each in main.parent.iterdir() if each.name.startswith(main.stem))
            if main.suffix.lower() == ".xosc":
                from pipeline.simulation.openscenario import referenced_files  # needed for these files only

                yield from referenced_files(main)
        for _, value in parse_qsl(query):
            yield main.parent / Path(value).expanduser()
            yield main / Path(value).expanduser()
    except (OSError, RuntimeError, ValueError):  # unreadable paths are reported when the recording is opened
        return


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            yield Path(parent, name)
