"""Every kind of source, declared once.

A new kind is one file with a function ``open_recording(uri, rest, how)``, and one entry in ``KINDS``. Error messages,
the help of commands and the page's list of recordings use this list. This module does not import the modules it names,
so that help is quick.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class SourceKind:
    """One kind of recording or device, how it is recognised and what opens it."""

    scheme: str
    """What a URI of this kind begins with, without the colon."""
    usage: str
    """What a person types, for help and error texts."""
    opener: str
    """``module:function`` that opens it, called with the URI, the part after the colon and an ``Opening``."""
    folders: tuple[str, ...] = ()
    """A folder with one of these folders inside is of this kind."""
    files: tuple[str, ...] = ()
    """A folder with a file that matches one of these patterns is of this kind."""
    suffixes: tuple[str, ...] = ()
    """A file whose name ends so is of this kind."""
    bare_suffixes: tuple[str, ...] = ()
    """A path that ends so is opened without a scheme."""
    is_live: bool = False
    """It names devices, which have no frames to choose from."""
    built_in: str = ""
    """``module:function`` that lists what comes with the product: (part after the colon, title) pairs."""

    def load(self) -> Any:
        """The function that opens it."""
        return _imported(self.opener)

    def offers(self) -> list[tuple[str, str]]:
        """(uri, title) of each recording of this kind that comes with the product."""
        return [(f"{self.scheme}:{rest}", title) for rest, title in _imported(self.built_in)()] if self.built_in else []


KINDS: tuple[SourceKind, ...] = (
    SourceKind("mcap", "session.mcap", "pipeline.recording.session.source:open_recording", bare_suffixes=(".mcap",)),
    SourceKind(
        "pcap", "pcap:<file>", "pipeline.sources.pcap.source:open_recording", suffixes=(".pcap", ".pcapng", ".cap")
    ),
    SourceKind(
        "rosbag",
        "rosbag:<path>",
        "pipeline.sources.rosbag.source:open_recording",
        files=("metadata.yaml",),
        suffixes=(".bag", ".db3"),
    ),
    SourceKind("pcd", "pcd:<dir>", "pipeline.sources.pcd:open_recording", files=("*.pcd",)),
    SourceKind(
        "astyx", "astyx:<dir>", "pipeline.sources.astyx:open_recording", folders=("lidar_vlp16", "camera_front")
    ),
    SourceKind(
        "kitti",
        "kitti:<dir>",
        "pipeline.sources.kitti:open_recording",
        folders=("velodyne", "velodyne_points"),
        files=("*_drive_*",),
    ),
    SourceKind(
        "video",
        "video:<file>",
        "pipeline.sources.camera_alone:open_video",
        suffixes=(".mp4", ".avi", ".mkv", ".mov", ".mjpeg"),
    ),
    SourceKind(
        "pictures",
        "pictures:<dir>",
        "pipeline.sources.camera_alone:open_images",
        files=("*.jpg", "*.jpeg", "*.png"),
    ),
    SourceKind(
        "sim",
        "sim:<scenario or my.yaml>",
        "pipeline.sources.simulated:open_recording",
        built_in="pipeline.simulation.built_in:offers",
    ),
    SourceKind("live", "live:<config.yaml>", "pipeline.sources.live.source:open_sensors", is_live=True),
)
"""In the order in which help and error texts list them."""


def usages(*, live: bool = True) -> str:
    """What can be typed for a source, as a list in words; without live sensors where only recordings are taken."""
    return ", ".join(kind.usage for kind in KINDS if live or not kind.is_live)


def built_in() -> list[tuple[str, str]]:
    """(uri, title) of every recording that comes with the product: the simulator's scenarios."""
    return [offer for kind in KINDS for offer in kind.offers()]


def kind_named(scheme: str) -> SourceKind | None:
    """The kind of that scheme."""
    return next((kind for kind in KINDS if kind.scheme == scheme), None)


def is_live(uri: str) -> bool:
    """Whether a URI names devices that are read as they deliver."""
    scheme, colon, _ = uri.partition(":")
    kind = kind_named(scheme)
    return kind is not None and bool(colon) and kind.is_live


def kind_of_bare(path: str) -> SourceKind | None:
    """The kind that opens a path without a scheme."""
    return next((kind for kind in KINDS if path.lower().endswith(kind.bare_suffixes or ("\0",))), None)


def looks_like(path: Path) -> str | None:
    """The scheme of a file or folder, by what lies in it or by its name; None for what is no recording that needs one.

    The folders inside say most, then the files inside, then the path's own suffix.
    """
    for kind in KINDS:
        if any((path / inside).is_dir() for inside in kind.folders):
            return kind.scheme
    if path.is_dir():
        for kind in KINDS:
            if any(any(path.glob(pattern)) for pattern in kind.files):
                return kind.scheme
    return next((kind.scheme for kind in KINDS if path.suffix.lower() in kind.suffixes), None)


def _imported(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(import_module(module), function)
