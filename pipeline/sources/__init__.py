"""Recordings, devices and the simulator behind one door: ``open_source("astyx:~/data/astyx")``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.common.progress import Progress, silent
from pipeline.types.source import LIVE, AnySource, LiveSource, Source, SourceError, TruthObject

__all__ = [
    "LiveSource",
    "Source",
    "SourceError",
    "TruthObject",
    "is_live",
    "looks_like",
    "open_any",
    "open_live",
    "open_source",
]

_SESSION_SUFFIX = ".mcap"


def _open_astyx(uri: str, path: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.astyx import AstyxSource

    return AstyxSource(uri, path)


def _open_kitti(uri: str, path: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.kitti import KittiSource

    return KittiSource(uri, path, rings)


def _open_simulated(uri: str, name: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.simulated import SimulatedSource  # the simulator's cameras and cars: only who drives one pays

    return SimulatedSource(uri, name)


def _open_session(uri: str, path: str, rings: int, progress: Progress) -> Source:
    from pipeline.recording.session_source import SessionSource  # half a second of imports: only who opens one pays

    return SessionSource(uri, path, progress)


def _open_pcap(uri: str, rest: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.pcap import PcapSource  # decoder and video libraries: only who opens one pays

    return PcapSource(uri, rest, progress)


def _open_pcd(uri: str, rest: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.pcd import PcdSource

    return PcdSource(uri, rest)


def _open_rosbag(uri: str, rest: str, rings: int, progress: Progress) -> Source:
    from pipeline.sources.rosbag import RosbagSource

    return RosbagSource(uri, rest, progress)


_OPENERS: dict[str, Callable[[str, str, int, Progress], Source]] = {
    "astyx": _open_astyx,
    "kitti": _open_kitti,
    "mcap": _open_session,
    "pcap": _open_pcap,
    "pcd": _open_pcd,
    "rosbag": _open_rosbag,
    "sim": _open_simulated,
}
"""Scheme → what opens it, given the whole URI, the part after the colon, how many LiDAR rings to keep, and whom to tell
how far it is."""

_MARKS = {"lidar_vlp16": "astyx", "camera_front": "astyx", "velodyne": "kitti", "velodyne_points": "kitti"}
"""A folder with this one inside is such a recording."""
_SUFFIXES = {".pcap": "pcap", ".pcapng": "pcap", ".cap": "pcap", ".bag": "rosbag", ".db3": "rosbag"}
"""A file whose name ends so is such a recording."""


def open_source(uri: str, *, rings: int = 16, progress: Progress = silent) -> Source:
    """Open ``scheme:rest``, or the path of a session. ``rings``: how many rings to keep of a LiDAR that has more
    (KITTI's HDL-64). ``progress``: told how much was read, where a whole file has to be.

    SourceError, in one sentence, when the scheme is unknown or the recording cannot be opened.
    """
    if is_live(uri):
        raise SourceError(f"{uri}: live sensors have no frames to choose from; a recording is needed here")
    return _open_recording(uri, rings, progress, tuple(_OPENERS))


def _open_recording(uri: str, rings: int, progress: Progress, kinds: tuple[str, ...]) -> Source:
    """kinds: what may be typed where this was."""
    scheme, colon, rest = uri.partition(":")
    is_drive_letter = len(scheme) == 1
    if not colon or is_drive_letter or not scheme.isalnum():
        if uri.lower().endswith(_SESSION_SUFFIX):
            return _open_session(uri, uri, rings, progress)
        raise SourceError(_about_bare_path(uri, kinds))
    if scheme not in _OPENERS:
        raise SourceError(f"{uri}: no kind of source named {scheme!r}; there are {', '.join(kinds)}")
    return _OPENERS[scheme](uri, rest, rings, progress)


def is_live(uri: str) -> bool:
    """Whether it names devices that are read as they deliver, which ``open_live`` opens."""
    return uri.startswith(LIVE)


def open_live(uri: str) -> LiveSource:
    """Open ``live:<config.yaml>``; ``start`` it to read. SourceError when the file cannot be used."""
    from pipeline.sources.live.config import load  # drivers of sensors: only who has sensors pays for them
    from pipeline.sources.live.source import LiveSensors

    return LiveSensors(uri, load(uri.removeprefix(LIVE)))


def open_any(uri: str, *, rings: int = 16, progress: Progress = silent) -> AnySource:
    """Devices or a recording, whichever it names. SourceError as of the two."""
    if is_live(uri):
        return open_live(uri)
    return _open_recording(uri, rings, progress, (*_OPENERS, LIVE.removesuffix(":")))


def _about_bare_path(path: str, kinds: tuple[str, ...]) -> str:
    """What to type instead of a path without a scheme."""
    try:
        scheme = looks_like(Path(path).expanduser()) if path else None
    except (OSError, RuntimeError, ValueError):
        scheme = None
    if scheme is not None:
        return f"{path}: say what kind of recording it is; it looks like {scheme}:{path}"
    return f"{path}: not a source; type one of {', '.join(f'{kind}:…' for kind in kinds)}"


def looks_like(path: Path) -> str | None:
    """The scheme of a file or folder, by its name or what lies in it; null when it is no recording that needs one."""
    for inside, scheme in _MARKS.items():
        if (path / inside).is_dir():
            return scheme
    if (path / "metadata.yaml").is_file():
        return "rosbag"
    if path.is_dir() and any(path.glob("*.pcd")):
        return "pcd"
    return _SUFFIXES.get(path.suffix.lower())
