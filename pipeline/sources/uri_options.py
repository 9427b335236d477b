"""Options in a source's URI: ``path?name=value&name=value``."""

from __future__ import annotations

import os
from urllib.parse import parse_qsl

from pipeline.types.source import SourceError


def path_and_options(rest: str) -> tuple[str, str]:
    """The path, and the options after its question mark. A name may have a question mark itself: the longest path that
    exists is meant."""
    end = len(rest)
    while end >= 0:
        path = os.path.expanduser(rest[:end])
        if "?" in path and "\0" not in path and os.path.lexists(path):
            return rest[:end], rest[end + 1 :]
        end = rest.rfind("?", 0, end)
    path, _, options = rest.partition("?")
    return path, options


def split_options(rest: str, known: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """The path and its options. SourceError for an option that does not exist or is given twice."""
    path, query = path_and_options(rest)
    options: dict[str, str] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in known:
            raise SourceError(f"{rest}: unknown option {name!r}; the options are {', '.join(known)}")
        if name in options or not value:
            raise SourceError(f"{rest}: option {name!r} {'is given twice' if name in options else 'has no value'}")
        options[name] = value
    if len(path) < len(rest) and not query:
        raise SourceError(f"{rest}: nothing after the question mark")
    return path, options


def number_option(options: dict[str, str], name: str, otherwise: float) -> float:
    """A finite number. SourceError for anything else."""
    try:
        value = float(options.get(name, otherwise))
    except ValueError:
        value = float("nan")
    if not abs(value) < 1e9:
        raise SourceError(f"{name}={options[name]}: not a number")
    return value
