"""Options in a source's URI: ``path?name=value&name=value``."""

from __future__ import annotations

from urllib.parse import parse_qsl

from pipeline.types.source import SourceError


def split_options(rest: str, known: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """The path and its options. SourceError for an option that does not exist or is given twice."""
    path, mark, query = rest.partition("?")
    options: dict[str, str] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in known:
            raise SourceError(f"{rest}: unknown option {name!r}; the options are {', '.join(known)}")
        if name in options or not value:
            raise SourceError(f"{rest}: option {name!r} {'is given twice' if name in options else 'has no value'}")
        options[name] = value
    if mark and not query:
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
