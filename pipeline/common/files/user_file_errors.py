"""Describes an error in a user's file in one sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError

from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import is_remote
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular

_MOST_NODES = 200_000
"""Maximum number of values in a YAML document; a few dozen bytes of aliases can expand to billions."""
_QUOTED = re.compile("['\"].*['\"]", re.DOTALL)
_PLAIN_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}")
_IN_OUR_WORDS = {
    "extra_forbidden": "no such setting",
    "missing": "is missing",
    "list_type": "must be a list",
    "model_type": "must be a mapping of settings",
}


def read_yaml(path: Path, what: str, refuse: Callable[[str], BadInput] = BadInput) -> Any:
    """The plain values of a YAML file; None if it is empty. On failure, raises the error that ``refuse`` makes from a
    sentence that begins with ``what``."""
    try:
        text = read_regular(path, LARGEST_TEXT_BYTES).decode("utf-8")
    except UnicodeDecodeError:
        raise refuse(f"{what}: not YAML: not a text file") from None
    except (OSError, ValueError) as error:
        raise refuse(f"{what}: cannot be read: {reason_of(error)}") from None
    return parse_yaml(text, what, refuse)


def parse_yaml(text: str, what: str, refuse: Callable[[str], BadInput] = BadInput) -> Any:
    """Like ``read_yaml``, for a text. The message gives the position of an error but never the content: a user who
    opens a file by mistake must not see what is in it."""
    try:
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        if _nodes_of(node, {}) > _MOST_NODES:
            raise refuse(f"{what}: not YAML: its aliases expand to more than {_MOST_NODES} values")
        return None if node is None else loader.construct_document(node)
    except BadInput:
        raise
    except RecursionError:
        raise refuse(f"{what}: not YAML: nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        mark, said = error.problem_mark or error.context_mark, (error.context, error.problem)
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark is not None else None
        raise refuse(f"{what}: not YAML: {_without_content(', '.join(filter(None, (*said, where))))}") from None
    except ValueError as error:  # an invalid date, an infinite number
        raise refuse(f"{what}: not YAML: {_without_content(str(error))}") from None
    except Exception:  # a value that does not fit its tag (``!!int ""``): PyYAML lets arbitrary exceptions through
        raise refuse(f"{what}: not YAML: a value does not match its tag") from None


def _without_content(text: str) -> str:
    """A parser's message on one line, without the content that it quotes."""
    return _QUOTED.sub("…", (text.splitlines() or ["damaged"])[0])


def _nodes_of(node: yaml.Node | None, known: dict[int, int]) -> int:
    """Number of values in a document after alias expansion; over the limit if it contains itself."""
    if node is None:
        return 0
    if id(node) not in known:
        known[id(node)] = _MOST_NODES + 1
        inside: list[yaml.Node] = node.value if isinstance(node, yaml.SequenceNode) else []
        if isinstance(node, yaml.MappingNode):
            inside = [each for pair in node.value for each in pair]
        known[id(node)] = 1 + sum(_nodes_of(each, known) for each in inside)
    return known[id(node)]


def given_path(text: str | Path, refuse: Callable[[str], BadInput] = BadInput) -> Path:
    """A path as typed by a user, with ``~`` resolved. On failure, raises the error that ``refuse`` makes from a
    sentence."""
    if is_remote(str(text)):
        raise refuse(f"{text}: an address in a store; expected a file or folder on this machine")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise refuse(f"{text}: unknown home directory") from None


def reason_of(error: Exception) -> str:
    """The reason of a system error, in words."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__


def first_complaint(error: ValidationError, model: type[BaseModel]) -> str:
    """The first validation error of ``model`` and its position; for an unknown name also the most similar known name,
    if any. Missing fields at the same position are listed together."""
    errors = error.errors()
    first = errors[0]
    place = first["loc"]
    missing = [each["loc"] for each in errors if each["type"] == "missing" and each["loc"][:-1] == place[:-1]]
    if first["type"] == "missing" and len(missing) > 1:
        return f"{', '.join('.'.join(map(str, each)) for each in missing)}: are missing"
    text = _IN_OUR_WORDS.get(first["type"], first["msg"].removeprefix("Value error, "))
    if first["type"] == "extra_forbidden":
        text += did_you_mean(str(place[-1]), _names_at(model, place[:-1]))
    where = ".".join(_shown(part) for part in place)
    return f"{where}: {text}" if where else text


def _shown(part: int | str) -> str:
    """A field name if it is safe to show; anything else may be arbitrary file content."""
    return str(part) if isinstance(part, int) or _PLAIN_NAME.fullmatch(part) else "…"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``; did you mean data_port?``; empty if no known name is similar."""
    near = get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def _names_at(model: type[BaseModel], place: Iterable[int | str]) -> list[str]:
    """The names of the settings at a position in the model."""
    below = [model]
    for part in place:
        fields = [above.model_fields[part] for above in below if part in above.model_fields]
        if fields:  # otherwise it is a list index or the tag of a union
            below = [each for field in fields for each in _models_in(field.annotation)]
    return [name for each in below for name in each.model_fields]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """The models that a field may hold, directly or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in _models_in(each)]
