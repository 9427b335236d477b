"""Opens recordings, devices and the simulator with one function: ``open_source("astyx:~/data/astyx")``.

``pipeline/source_kinds.py`` lists the kinds of source."""

from __future__ import annotations

from pathlib import Path
from typing import cast
from urllib.parse import unquote

from pipeline.common.files.remote_files import is_remote
from pipeline.common.progress import Progress, silent
from pipeline.source_kinds import SourceKind, is_live, kind_named, kind_of_bare, looks_like, usages
from pipeline.sources.recognition import recording_at
from pipeline.sources.unrecognised import about_path
from pipeline.types.source import AnySource, LiveSource, Opening, Source, SourceError, TruthObject

__all__ = [
    "LiveSource",
    "Source",
    "SourceError",
    "SourceKind",
    "TruthObject",
    "is_live",
    "looks_like",
    "open_any",
    "open_live",
    "open_source",
    "usages",
]

_FILE = "file://"
_IN_STORE = "files ending in .mcap; `cipv import` converts any recording to one"


def open_source(uri: str, *, rings: int = 16, progress: Progress = silent) -> Source:
    """Open a recording: ``scheme:rest``, or a path that is recognised by its content.

    Args:
        uri: as typed by a user.
        rings: how many rings to keep if the LiDAR has more (KITTI's HDL-64).
        progress: receives the reading progress if a whole file must be read.

    Raises:
        SourceError: in one sentence, if the scheme is unknown, names devices, or the recording cannot be opened.
    """
    kind, rest = _kind_and_rest(uri, live=False)
    if kind.is_live:
        raise SourceError(f"{uri}: these are live sensors; a recording is needed here")
    return cast("Source", kind.load()(uri, rest, Opening(rings, progress)))


def open_live(uri: str) -> LiveSource:
    """Open ``live:<config.yaml>``; ``start`` it to read. SourceError if the file cannot be used."""
    kind, rest = _kind_and_rest(uri, live=True)
    if not kind.is_live:
        raise SourceError(f"{uri}: this is a recording; live sensors are needed here")
    return cast("LiveSource", kind.load()(uri, rest, Opening()))


def open_any(uri: str, *, rings: int = 16, progress: Progress = silent) -> AnySource:
    """Open devices or a recording, depending on the URI. Raises the same errors as ``open_source``."""
    kind, rest = _kind_and_rest(uri, live=True)
    return cast("AnySource", kind.load()(uri, rest, Opening(rings, progress)))


def _kind_and_rest(uri: str, *, live: bool) -> tuple[SourceKind, str]:
    """The source kind of a URI, and the part after its scheme. live: whether error texts mention live sensors, too."""
    if is_remote(uri):
        in_store = kind_of_bare(uri)
        if in_store is None or in_store.scheme != "mcap":
            raise SourceError(f"{uri}: only sessions can be opened in a store: {_IN_STORE}")
        return in_store, uri
    if uri.startswith(_FILE):  # as file managers and browsers name a file
        return _kind_and_rest(_path_of(uri), live=live)
    scheme, colon, rest = uri.partition(":")
    kind = kind_named(scheme)
    is_drive_letter = len(scheme) == 1
    if not colon or is_drive_letter or not scheme.isalnum() or (kind is None and _exists(uri)):
        found = recording_at(uri)
        if found is None:
            raise SourceError(f"{uri}: not a source{about_path(uri, live)}")
        return found
    if kind is None:
        raise SourceError(f"{uri}: unknown kind of source {scheme!r}; use one of {usages(live=live)}")
    # the folder around a recording stands for it with a scheme, too: kitti:kitti_0009 holds one day with one drive
    inside = recording_at(rest) if kind.folders or kind.files else None
    return kind, inside[1] if inside is not None and inside[0] is kind else rest


def _path_of(address: str) -> str:
    """The path in an address that begins with ``file://``; options are kept."""
    path, mark, options = address.removeprefix(_FILE).removeprefix("localhost").partition("?")
    return f"{unquote(path)}{mark}{options}"


def _exists(uri: str) -> bool:
    """Whether it is an existing path with a colon in its name."""
    try:
        return Path(uri).exists()
    except (OSError, ValueError):
        return False
