"""What a path without a scheme is: the recording that it names, and the one that it is a part of."""

from __future__ import annotations

import os
from contextlib import suppress
from fnmatch import fnmatch
from itertools import islice
from pathlib import Path

from pipeline.common.files.user_files import Overloaded, check_allowed, open_regular
from pipeline.source_kinds import KINDS, SourceKind, kind_by_first_bytes, kind_named, kind_of_bare, looks_like
from pipeline.sources.uri_options import path_and_options

_FIRST_BYTES = 64
DEEPEST = 3
"""Depth of nested folders that are searched for a recording: ``data/2011_09_26/2011_09_26_drive_0009_sync``."""
MOST_ENTRIES = 1000
"""Maximum entries of a folder that are examined: other folders may have millions."""
_SHARED = ("calib_*.txt", "calibration", "data_poses")
"""Names of what several recordings of a folder share: a calibration and poses of KITTI and KITTI-360."""
PROBLEMS = (OSError, RuntimeError, ValueError, Overloaded)
"""Errors that a path may cause: unknown home directory, a null byte, a link to itself."""


def recording_at(uri: str) -> tuple[SourceKind, str] | None:
    """The source kind for a path without a scheme, and its argument; options may follow a question mark.

    A folder that contains a single recording stands for that one. Files with the same name are one recording: a capture
    and the video beside it. None if there is nothing of a known kind.
    """
    bare = kind_of_bare(uri)
    if bare is not None and not os.path.isdir(os.path.expanduser(uri)):
        return _by_content(Path(uri)) or bare, uri
    path, options = path_and_options(uri)
    try:
        found = _recording(Path(path).expanduser(), DEEPEST) if path else None
    except PROBLEMS:
        return None
    if found is None or (found[1] is None and _is_only_a_part(Path(path).expanduser(), found[0])):
        return None
    kind, place = found
    return kind, uri if place is None else f"{place}{'?' if options else ''}{options}"


def _is_only_a_part(place: Path, kind: SourceKind) -> bool:
    """Whether a folder that seems to contain recordings is a part of one, such as the poses of KITTI-360's drives."""
    if not kind.is_layout or not place.is_dir() or kind.has_folders_in(place):
        return False
    around = recording_around(place)
    return around is not None and kind.has_folders_in(around)


def recording_around(place: Path) -> Path | None:
    """The folder of the recording that a file or folder is a part of, such as ``image_02`` of a KITTI drive; None if it
    is not part of one, or if that may not be revealed."""
    for folder in list(place.absolute().parents)[:DEEPEST]:
        with suppress(*PROBLEMS):
            check_allowed(folder)
            scheme = looks_like(folder)
            kind = kind_named(scheme) if scheme is not None else None
            if kind is not None and kind.has_folders_in(folder):
                return folder
            is_beside = folder == place.absolute().parent and any(fnmatch(place.name, each) for each in _SHARED)
            if kind is not None and kind.is_layout and is_beside:
                return folder  # contains recordings, such as KITTI's folder of a day
    return None


def _recording(place: Path, deepest: int) -> tuple[SourceKind, Path | None] | None:
    """The kind of a path, and the path inside it if the recording is not the path itself."""
    kind = kind_of(place)
    if kind is not None and not _holds_one_of_its_own(place, kind):
        return kind, None
    if deepest == 0 or not place.is_dir():
        return (kind, None) if kind is not None else None
    inside = [(found, each) for each in entries(place) if (found := kind_of(each)) is not None]
    if len({each.stem for _, each in inside}) == 1:
        first, path = min(inside, key=lambda pair: KINDS.index(pair[0]))
        deeper = _recording(path, deepest - 1)
        return (deeper[0], deeper[1] or path) if deeper is not None else (first, path)
    if kind is not None or inside:
        return (kind, None) if kind is not None else None
    folders = [each for each in entries(place) if is_folder(each)]
    if len(folders) != 1:
        return None
    deeper = _recording(folders[0], deepest - 1)
    return (deeper[0], deeper[1] or folders[0]) if deeper is not None else None


def _holds_one_of_its_own(place: Path, kind: SourceKind) -> bool:
    """Whether a folder was recognised by recordings inside it, such as KITTI's folder of a day."""
    return (
        place.is_dir()
        and not any((place / name).is_dir() for name in kind.folders)
        and any(each.is_dir() and looks_like(each) == kind.scheme for each in entries(place))
    )


def kind_of(place: Path) -> SourceKind | None:
    """By the content of a folder, by a file's name, else by its first bytes."""
    bare = kind_of_bare(place.name)
    if bare is not None and place.is_file():
        return _by_content(place) or bare
    scheme = looks_like(place)
    if scheme is not None:
        return kind_named(scheme)
    return _by_content(place)


def _by_content(path: Path) -> SourceKind | None:
    """By the first bytes of a file; None if they are unknown or the file cannot be read."""
    try:
        return kind_by_first_bytes(first_bytes(path.expanduser())) if path.expanduser().is_file() else None
    except PROBLEMS:
        return None


def entries(folder: Path) -> list[Path]:
    """Entries of a folder, sorted; hidden files are skipped, and the rest of very large folders."""
    with os.scandir(folder) as found:
        names = islice((each.name for each in found if not each.name.startswith(".")), MOST_ENTRIES)
        return [folder / name for name in sorted(names)]


def is_folder(path: Path) -> bool:
    """Whether a path is a folder itself, not a link to one, and may be read."""
    return os.path.isdir(path) and not os.path.islink(path)


def first_bytes(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read(_FIRST_BYTES)
