"""Opens recordings, devices and the simulator with one function: ``open_source("astyx:~/data/astyx")``.

``pipeline/source_kinds.py`` lists the kinds of source."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import cast

from pipeline.common.progress import Progress, silent
from pipeline.common.remote_files import is_remote
from pipeline.source_kinds import SourceKind, is_live, kind_named, kind_of_bare, looks_like, usages
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

_IN_STORE = "files ending in .mcap; `cipv import` converts any recording to one"


def open_source(uri: str, *, rings: int = 16, progress: Progress = silent) -> Source:
    """Open a recording: ``scheme:rest``, or a path that is recognised by what is in it.

    Args:
        uri: what a person typed.
        rings: how many rings to keep of a LiDAR that has more (KITTI's HDL-64).
        progress: told how much was read, where a whole file has to be.

    Raises:
        SourceError: in one sentence, when the scheme is unknown, names devices, or the recording cannot be opened.
    """
    kind, rest = _kind_and_rest(uri, live=False)
    if kind.is_live:
        raise SourceError(f"{uri}: these are live sensors; a recording is needed here")
    return cast("Source", kind.load()(uri, rest, Opening(rings, progress)))


def open_live(uri: str) -> LiveSource:
    """Open ``live:<config.yaml>``; ``start`` it to read. SourceError when the file cannot be used."""
    kind, rest = _kind_and_rest(uri, live=True)
    if not kind.is_live:
        raise SourceError(f"{uri}: this is a recording; live sensors are needed here")
    return cast("LiveSource", kind.load()(uri, rest, Opening()))


def open_any(uri: str, *, rings: int = 16, progress: Progress = silent) -> AnySource:
    """Open devices or a recording, whichever the URI names. Errors as of ``open_source``."""
    kind, rest = _kind_and_rest(uri, live=True)
    return cast("AnySource", kind.load()(uri, rest, Opening(rings, progress)))


def _kind_and_rest(uri: str, *, live: bool) -> tuple[SourceKind, str]:
    """What opens a URI, and the part after its scheme. live: whether error texts offer live sensors, too."""
    if is_remote(uri):
        in_store = kind_of_bare(uri)
        if in_store is None:
            raise SourceError(f"{uri}: only sessions can be opened in a store: {_IN_STORE}")
        return in_store, uri
    scheme, colon, rest = uri.partition(":")
    is_drive_letter = len(scheme) == 1
    if not colon or is_drive_letter or not scheme.isalnum():
        bare = kind_of_bare(uri) or _recognised(uri)
        if bare is None:
            raise SourceError(_about_bare_path(uri, live))
        return bare, uri
    kind = kind_named(scheme)
    if kind is None:
        raise SourceError(f"{uri}: unknown kind of source {scheme!r}; use one of {usages(live=live)}")
    return kind, rest


def _recognised(uri: str) -> SourceKind | None:
    """The kind of a path without a scheme, by what is in it; options may follow a question mark."""
    try:
        scheme = looks_like(Path(uri.partition("?")[0]).expanduser()) if uri else None
    except (OSError, RuntimeError, ValueError):
        scheme = None
    return kind_named(scheme) if scheme is not None else None


def _about_bare_path(uri: str, live: bool) -> str:
    """What a path without a scheme that is of no known kind holds, and what to type instead."""
    return f"{uri}: not a source{_holding(uri.partition('?')[0])}; use one of {usages(live=live)}"


def _holding(path: str) -> str:
    """What lies there, in words; empty where nothing does."""
    try:
        place = Path(path).expanduser()
        if not path or not place.exists():
            return ""
        if place.is_file():
            return f": a {place.suffix} file" if place.suffix else ": unknown file type"
        inside = sorted(place.iterdir())
        recordings = [each for each in inside if looks_like(each) is not None]
    except (OSError, RuntimeError, ValueError):
        return ""
    if recordings:
        return f": it holds recordings, for example {recordings[0]}"
    folders = [each.name for each in inside if each.is_dir()]
    kinds = Counter(each.suffix or "unnamed" for each in inside if each.is_file())
    parts = [f"{count} {suffix} files" for suffix, count in kinds.most_common(3)]
    parts += [f"folders {', '.join(folders[:4])}"] if folders else []
    return f": it holds {' and '.join(parts) or 'nothing'}"
