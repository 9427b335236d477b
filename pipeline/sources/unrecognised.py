"""What a path that is no recording looks like, and what is missing or to be done, in one line."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import check_allowed
from pipeline.source_kinds import usages
from pipeline.sources.recognition import (
    DEEPEST,
    MOST_ENTRIES,
    PROBLEMS,
    entries,
    first_bytes,
    is_folder,
    kind_of,
    recording_around,
)
from pipeline.sources.uri_options import path_and_options

_MOST_LOOKED_AT = 3000
"""Maximum entries examined in all folders inside one, to find a recording."""
_IMAGE = "one image; open its folder, which is played in order of name"
_CLOUD = "one point cloud; open its folder, which is played in order of name"
_ARCHIVE = "an archive; unpack it and open the folder"
_FILES: tuple[tuple[tuple[str, ...], str], ...] = (
    ((".jpg", ".jpeg", ".png"), _IMAGE),
    (
        (".bmp", ".webp", ".tif", ".tiff", ".ppm", ".pgm", ".heic"),
        "an image of an unsupported format; convert the folder's images to PNG or JPEG",
    ),
    (
        (".h264", ".h265", ".264", ".265", ".hevc"),
        "images without times; put them into a video file, for example with `ffmpeg -r 25 -i {path} -c copy drive.mp4`",
    ),
    ((".onnx",), "a network; use it as --detector or --lanes"),
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


def about_path(uri: str, live: bool) -> str:
    """What a path of unknown kind looks like, and what to do; begins with a colon or a semicolon. live: whether live
    sensors are mentioned."""
    path, _ = path_and_options(uri)
    otherwise = f"; use one of {usages(live=live)}"
    try:
        place = Path(path).expanduser()
        if not path or not _is_there(place):
            return f": no such file or folder{otherwise}" if os.sep in path else otherwise
        check_allowed(place)
        around = recording_around(place)
        if around is not None:
            return f": a part of the recording {around}; open that folder"
        if place.is_dir() or place.is_file():
            found = _about_folder(place) if place.is_dir() else _about_file(place)
            return f": {found}" if ";" in found else f": {found}{otherwise}"
        return f": {'a broken link' if place.is_symlink() else 'not a file or folder'}{otherwise}"
    except PROBLEMS as error:
        return f": cannot be read: {reason_of(error)}"


def _is_there(place: Path) -> bool:
    """Whether the path exists, including broken links. OSError if that may not be revealed."""
    try:
        os.lstat(place)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _about_file(path: Path) -> str:
    begin = first_bytes(path)
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
    inside = entries(folder)
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
    several = "at least " if len(inside) == MOST_ENTRIES else ""
    usual = next((each for each in inside if suffixes and each.suffix == suffixes.most_common(1)[0][0]), None)
    meaning = _about_suffix(usual) if usual is not None else None
    return f"it holds {several}{' and '.join(parts)}" + (f" ({usual.name}: {meaning})" if usual and meaning else "")


def _recordings_below(folder: Path) -> Iterator[Path]:
    """Nearest first. Unreadable entries are skipped, and the rest if there are too many."""
    level, looked_at = [folder], 0
    for _ in range(DEEPEST):
        inside: list[Path] = []
        for each in level:
            with suppress(*PROBLEMS):
                inside += entries(each)
            if looked_at + len(inside) > _MOST_LOOKED_AT:
                break
        looked_at += len(inside)
        for each in inside:
            with suppress(*PROBLEMS):
                if kind_of(each) is not None:
                    yield each
        level = [each for each in inside if is_folder(each)]
        if looked_at > _MOST_LOOKED_AT:
            return
