"""What a path without a scheme is: the recording that it names, or what it looks like and what is missing."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import Overloaded, check_allowed, open_regular
from pipeline.source_kinds import KINDS, SourceKind, kind_by_first_bytes, kind_named, kind_of_bare, looks_like, usages

_FIRST_BYTES = 64
_DEEPEST = 3
"""Depth of nested folders that are searched for a recording: ``data/2011_09_26/2011_09_26_drive_0009_sync``."""
_MOST_ENTRIES = 1000
"""Maximum entries of a folder that are examined: other folders may have millions."""
_MOST_LOOKED_AT = 3000
"""Maximum entries examined in all folders inside one, to find a recording."""
_PROBLEMS = (OSError, RuntimeError, ValueError, Overloaded)
"""Errors that a path may cause: unknown home directory, a null byte, a link to itself."""

_IMAGE = "one image; open its folder, which is played in order of name"
_CLOUD = "one point cloud; open its folder, which is played in order of name"
_ARCHIVE = "an archive; unpack it and open the folder"
_FILES: tuple[tuple[tuple[str, ...], str], ...] = (
    ((".jpg", ".jpeg", ".png"), _IMAGE),
    ((".pcd",), _CLOUD),
    ((".bin",), "raw points or packets; open the folder of the recording that it belongs to"),
    ((".gpx", ".nmea", ".nma"), "a GNSS track; open the video or recording that it belongs to, or use it as --route"),
    ((".yaml", ".yml"), "a settings file; use live:{path} for sensors, sim:{path} for a scenario"),
    ((".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".zst", ".7z", ".rar"), _ARCHIVE),
    ((".csv", ".ply", ".las", ".laz", ".xyz", ".e57"), "a point cloud or table; convert sweeps to PCD, one file each"),
    (
        (".h5", ".hdf5", ".npy", ".npz", ".parquet", ".tfrecord"),
        "an unsupported data format; convert it to a ROS bag",
    ),
    ((".osf",), "an Ouster recording; convert it to a ROS bag of PointCloud2 or to PCD files"),
    ((".rrd",), "an export for the rerun viewer; open the recording that it was made from"),
    ((".blf", ".asc", ".mf4", ".dbc"), "a log or definition of a vehicle bus, without LiDAR and images"),
    ((".xodr",), "an OpenDRIVE road network; open the OpenSCENARIO file (.xosc) that uses it"),
)
"""Common other files, by suffix: what they are, and what to do."""
_FOLDERS: tuple[tuple[str, str], ...] = (
    ("samples/LIDAR_TOP", "files of nuScenes without their tables; the folder v1.0-mini or v1.0-trainval is missing"),
    (
        "sensors/lidar",
        "an unsupported Argoverse 2 log; convert it to a ROS bag or to PCD files, one per sweep",
    ),
    (
        "LIDAR_CONCAT",
        "an unsupported TIER IV data set; convert it to a ROS bag or to PCD files, one per sweep",
    ),
    ("poses", "poses of KITTI's odometry sequences; the folders with velodyne and calib.txt are missing"),
)
"""The same for folders, by a folder inside."""
_BEGINS: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG", _IMAGE),
    (b"\xff\xd8\xff", _IMAGE),
    (b"# .PCD", _CLOUD),
    (b"PK\x03\x04", _ARCHIVE),
    (b"\x1f\x8b", _ARCHIVE),
    (b"#ROSBAG V", "a ROS 1 bag; rename it so that it ends in .bag"),
    (
        b"SQLite format 3",
        "a database; if it belongs to a ROS 2 bag, open the bag's folder or rename the file so that it ends in .db3",
    ),
)
"""The same by the first bytes of a file."""


def recording_at(uri: str) -> tuple[SourceKind, str] | None:
    """The source kind for a path without a scheme, and its argument; options may follow a question mark.

    A folder that contains a single recording stands for that one. Files with the same name are one recording: a capture
    and the video beside it. None if there is nothing of a known kind.
    """
    bare = kind_of_bare(uri)
    if bare is not None and not os.path.isdir(os.path.expanduser(uri)):
        return _by_content(Path(uri)) or bare, uri
    path, mark, options = uri.partition("?")
    try:
        found = _recording(Path(path).expanduser(), _DEEPEST) if path else None
    except _PROBLEMS:
        return None
    if found is None:
        return None
    kind, place = found
    return kind, uri if place is None else f"{place}{mark}{options}"


def about_path(uri: str, live: bool) -> str:
    """What a path of unknown kind looks like, and what to do; begins with a colon or a semicolon. live: whether live
    sensors are mentioned."""
    path = uri.partition("?")[0]
    otherwise = f"; use one of {usages(live=live)}"
    try:
        place = Path(path).expanduser()
        if not path or not _is_there(place):
            return f": no such file or folder{otherwise}" if os.sep in path else otherwise
        check_allowed(place)
        if place.is_dir() or place.is_file():
            found = _about_folder(place) if place.is_dir() else _about_file(place)
            return f": {found}" if ";" in found else f": {found}{otherwise}"
        return f": {'a broken link' if place.is_symlink() else 'not a file or folder'}{otherwise}"
    except _PROBLEMS as error:
        return f": cannot be read: {reason_of(error)}"


def _recording(place: Path, deepest: int) -> tuple[SourceKind, Path | None] | None:
    """The kind of a path, and the path inside it if the recording is not the path itself."""
    kind = _kind_of(place)
    if kind is not None and not _holds_one_of_its_own(place, kind):
        return kind, None
    if deepest == 0 or not place.is_dir():
        return (kind, None) if kind is not None else None
    inside = [(found, each) for each in _entries(place) if (found := _kind_of(each)) is not None]
    if len({each.stem for _, each in inside}) == 1:
        first, path = min(inside, key=lambda pair: KINDS.index(pair[0]))
        deeper = _recording(path, deepest - 1)
        return (deeper[0], deeper[1] or path) if deeper is not None else (first, path)
    if kind is not None or inside:
        return (kind, None) if kind is not None else None
    folders = [each for each in _entries(place) if _is_folder(each)]
    if len(folders) != 1:
        return None
    deeper = _recording(folders[0], deepest - 1)
    return (deeper[0], deeper[1] or folders[0]) if deeper is not None else None


def _holds_one_of_its_own(place: Path, kind: SourceKind) -> bool:
    """Whether a folder was recognised by recordings inside it, such as KITTI's folder of a day."""
    return (
        place.is_dir()
        and not any((place / name).is_dir() for name in kind.folders)
        and any(each.is_dir() and looks_like(each) == kind.scheme for each in _entries(place))
    )


def _kind_of(place: Path) -> SourceKind | None:
    """By the content of a folder, by a file's name, else by its first bytes."""
    bare = kind_of_bare(place.name)
    if bare is not None and place.is_file():
        return _by_content(place) or bare
    scheme = looks_like(place)
    if scheme is not None:
        return kind_named(scheme)
    return _by_content(place)


def _is_there(place: Path) -> bool:
    """Whether the path exists, including broken links. OSError if that may not be revealed."""
    try:
        os.lstat(place)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _by_content(path: Path) -> SourceKind | None:
    """By the first bytes of a file; None if they are unknown or the file cannot be read."""
    try:
        return kind_by_first_bytes(_first_bytes(path.expanduser())) if path.expanduser().is_file() else None
    except _PROBLEMS:
        return None


def _entries(folder: Path) -> list[Path]:
    """Entries of a folder, sorted; hidden files are skipped, and the rest of very large folders."""
    with os.scandir(folder) as found:
        names = islice((each.name for each in found if not each.name.startswith(".")), _MOST_ENTRIES)
        return [folder / name for name in sorted(names)]


def _is_folder(path: Path) -> bool:
    """Whether a path is a folder itself, not a link to one, and may be read."""
    return os.path.isdir(path) and not os.path.islink(path)


def _first_bytes(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read(_FIRST_BYTES)


def _about_file(path: Path) -> str:
    begin = _first_bytes(path)
    if not begin:
        return "an empty file"
    what = _about_suffix(path)
    if what is not None:
        return what
    for magic, what in _BEGINS:
        if begin.startswith(magic):
            return what
    is_text = all(byte >= 32 or byte in b"\t\r\n" for byte in begin)
    of = f" ({path.suffix})" if path.suffix else ""
    return f"a text file{of}" if is_text else f"a file of unknown content{of}"


def _about_suffix(path: Path) -> str | None:
    return next((what.format(path=path) for suffixes, what in _FILES if path.suffix.lower() in suffixes), None)


def _about_folder(folder: Path) -> str:
    inside = _entries(folder)
    if not inside:
        return "the folder is empty"
    for name, what in _FOLDERS:
        if (folder / name).is_dir() and not (folder / "sequences").is_dir():
            return what
    example = next(_recordings_below(folder), None)
    if example is not None:
        return f"it holds recordings; open one of them, for example {example}"
    folders = [each.name for each in inside if os.path.isdir(each)]
    suffixes = Counter(each.suffix or "unnamed" for each in inside if not os.path.isdir(each))
    parts = [f"{count} {suffix} file{'s' * (count > 1)}" for suffix, count in suffixes.most_common(3)]
    parts += [f"folder{'s' * (len(folders) > 1)} {', '.join(folders[:4])}"] if folders else []
    several = "at least " if len(inside) == _MOST_ENTRIES else ""
    usual = next((each for each in inside if suffixes and each.suffix == suffixes.most_common(1)[0][0]), None)
    meaning = _about_suffix(usual) if usual is not None else None
    return f"it holds {several}{' and '.join(parts)}" + (f" ({usual.name}: {meaning})" if usual and meaning else "")


def _recordings_below(folder: Path) -> Iterator[Path]:
    """Nearest first. Unreadable entries are skipped, and the rest if there are too many."""
    level, looked_at = [folder], 0
    for _ in range(_DEEPEST):
        inside: list[Path] = []
        for each in level:
            with suppress(*_PROBLEMS):
                inside += _entries(each)
            if looked_at + len(inside) > _MOST_LOOKED_AT:
                break
        looked_at += len(inside)
        for each in inside:
            with suppress(*_PROBLEMS):
                if _kind_of(each) is not None:
                    yield each
        level = [each for each in inside if _is_folder(each)]
        if looked_at > _MOST_LOOKED_AT:
            return
