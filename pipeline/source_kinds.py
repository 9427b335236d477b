"""Every kind of source, declared once.

A new kind is one file with a function ``open_recording(uri, rest, how)``, and one entry in ``KINDS``. Error messages,
the help of commands and the page's list of recordings use this list. This module does not import the modules it names,
so that help is quick.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

_MOST_ENTRIES = 20_000
VIDEO_SUFFIXES = (
    ".mp4", ".m4v", ".mov", ".3gp", ".avi", ".mkv", ".webm", ".mjpeg", ".ts", ".mts", ".m2ts", ".mpg", ".mpeg", ".wmv",
    ".asf", ".flv", ".ogv",
)  # fmt: skip
"""Suffixes of video files, with sound or without."""


@dataclass(frozen=True)
class SourceKind:
    """One kind of recording or device: how it is recognised and what opens it."""

    scheme: str
    """The URI scheme, without the colon."""
    usage: str
    """What a user types, for help and error texts."""
    opener: str
    """``module:function`` that opens it, called with the URI, the part after the colon and an ``Opening``."""
    folders: tuple[str, ...] = ()
    """A folder that contains one of these folders is of this kind."""
    files: tuple[str, ...] = ()
    """A folder that contains a file matching one of these patterns is of this kind."""
    suffixes: tuple[str, ...] = ()
    """A file with one of these suffixes is of this kind."""
    begins: tuple[tuple[int, bytes], ...] = ()
    """A file with one of these byte sequences at its offset is of this kind, whatever its name."""
    bare_suffixes: tuple[str, ...] = ()
    """A path with one of these suffixes is opened without a scheme."""
    is_live: bool = False
    """Whether it names devices, which have no random access."""
    built_in: str = ""
    """``module:function`` that lists the built-in recordings: (part after the colon, title) pairs."""

    @property
    def is_layout(self) -> bool:
        """Whether a recording is a folder with folders of its own, rather than files that may lie anywhere."""
        return bool(self.folders) or any("/" in pattern for pattern in self.files)

    def has_folders_in(self, place: Path) -> bool:
        """Whether a folder has the layout itself, rather than containing recordings."""
        if any((place / name).is_dir() for name in self.folders):
            return True
        return any("/" in pattern and _holds(place, _names(place), pattern) for pattern in self.files)

    def load(self) -> Any:
        """The function that opens it."""
        return _imported(self.opener)

    def offers(self) -> list[tuple[str, str]]:
        """(uri, title) of each built-in recording of this kind."""
        return [(f"{self.scheme}:{rest}", title) for rest, title in _imported(self.built_in)()] if self.built_in else []


KINDS: tuple[SourceKind, ...] = (
    SourceKind(
        "mcap",
        "session.mcap",
        "pipeline.recording.session.source:open_recording",
        begins=((0, b"\x89MCAP0\r\n"),),
        bare_suffixes=(".mcap",),
    ),
    SourceKind(
        "pcap",
        "pcap:<file>",
        "pipeline.sources.pcap.source:open_recording",
        suffixes=(".pcap", ".pcapng", ".cap"),
        begins=(
            (0, b"\xa1\xb2\xc3\xd4"),
            (0, b"\xd4\xc3\xb2\xa1"),
            (0, b"\xa1\xb2\x3c\x4d"),
            (0, b"\x4d\x3c\xb2\xa1"),
            (0, b"\x0a\x0d\x0d\x0a"),
        ),
    ),
    SourceKind(
        "rosbag",
        "rosbag:<path>",
        "pipeline.sources.rosbag.source:open_recording",
        files=("metadata.yaml",),
        suffixes=(".bag", ".db3"),
        begins=((21, b"ros2"), (21, b"ros1")),  # the profile of an MCAP file
    ),
    SourceKind("pcd", "pcd:<dir>", "pipeline.sources.pcd:open_recording", files=("*.pcd",)),
    SourceKind(
        "astyx", "astyx:<dir>", "pipeline.sources.astyx:open_recording", folders=("lidar_vlp16", "camera_front")
    ),
    SourceKind(
        "kitti",
        "kitti:<dir>",
        "pipeline.sources.kitti.source:open_recording",
        folders=("velodyne", "velodyne_points", "data_3d_raw", "data_2d_raw", "image_00/data_rect", "image_02/data"),
        files=("*_drive_*",),
    ),
    SourceKind(
        "nuscenes",
        "nuscenes:<dir>",
        "pipeline.sources.nuscenes:open_recording",
        files=("v1.0-*/sample_data.json", "v1.0-*/scene.json"),
    ),
    SourceKind("radiate", "radiate:<dir>", "pipeline.sources.radiate:open_recording", folders=("velo_lidar",)),
    SourceKind(
        "video",
        "video:<file>",
        "pipeline.sources.camera_alone:open_video",
        suffixes=VIDEO_SUFFIXES,
        begins=(
            (4, b"ftyp"),
            (8, b"AVI "),
            (0, b"\x1aE\xdf\xa3"),
            (0, b"FLV\x01"),
            (0, b"OggS"),
            (0, b"\x30\x26\xb2\x75\x8e\x66\xcf\x11"),  # ASF, WMV
            (0, b"\x00\x00\x01\xba"),  # MPEG-PS
        ),
    ),
    SourceKind(
        "pictures",
        "pictures:<dir>",
        "pipeline.sources.camera_alone:open_images",
        files=("*.jpg", "*.jpeg", "*.png"),
    ),
    SourceKind(
        "sim",
        "sim:<scenario, my.yaml or my.xosc>",
        "pipeline.sources.simulated:open_recording",
        bare_suffixes=(".xosc",),
        built_in="pipeline.simulation.built_in:offers",
    ),
    SourceKind("live", "live:<config.yaml>", "pipeline.sources.live.source:open_sensors", is_live=True),
)
"""In the order in which help and error texts list them."""


def usages(*, live: bool = True) -> str:
    """The source kinds that can be typed, as a list in words; without live sensors where only recordings are
    accepted."""
    return ", ".join(kind.usage for kind in KINDS if live or not kind.is_live)


def built_in() -> list[tuple[str, str]]:
    """(uri, title) of every built-in recording: the simulator's scenarios."""
    return [offer for kind in KINDS for offer in kind.offers()]


def kind_named(scheme: str) -> SourceKind | None:
    """The kind with this scheme."""
    return next((kind for kind in KINDS if kind.scheme == scheme), None)


def is_live(uri: str) -> bool:
    """Whether a URI names live devices."""
    scheme, colon, _ = uri.partition(":")
    kind = kind_named(scheme)
    return kind is not None and bool(colon) and kind.is_live


def kind_of_bare(path: str) -> SourceKind | None:
    """The kind that opens a path without a scheme."""
    return next((kind for kind in KINDS if path.lower().endswith(kind.bare_suffixes or ("\0",))), None)


def looks_like(path: Path) -> str | None:
    """The scheme for a file or folder, by its content or name; None if it is not a recording that needs a scheme.

    Folders inside it have priority, then files inside it, then its own suffix.
    """
    for kind in KINDS:
        if any((path / inside).is_dir() for inside in kind.folders):
            return kind.scheme
    if path.is_dir():
        names = _names(path)
        for kind in KINDS:
            if any(_holds(path, names, pattern) for pattern in kind.files):
                return kind.scheme
    return next((kind.scheme for kind in KINDS if path.suffix.lower() in kind.suffixes), None)


def _names(folder: Path) -> list[str]:
    """Names in a folder; for very large folders only the first ones, which suffice to recognise it. Empty if it cannot
    be read."""
    try:
        with os.scandir(folder) as found:
            return [each.name for each in islice(found, _MOST_ENTRIES)]
    except OSError:
        return []


def _holds(folder: Path, names: list[str], pattern: str) -> bool:
    """Whether one of these names matches a pattern, ignoring case; the part after a slash must exist in that folder."""
    first, _, rest = pattern.partition("/")
    of_pattern = (name for name in names if fnmatchcase(name.lower(), first))
    return any(not rest or (folder / name / rest).exists() for name in of_pattern)


def kind_by_first_bytes(begin: bytes) -> SourceKind | None:
    """The kind of a file that starts with these bytes; if several match, the match farthest into the file."""
    found = [(at, kind) for kind in KINDS for at, magic in kind.begins if begin[at:].startswith(magic)]
    return max(found, key=lambda each: each[0])[1] if found else None


def _imported(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(import_module(module), function)
