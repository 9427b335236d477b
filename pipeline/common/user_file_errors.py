"""What is wrong with a file that the user wrote, in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError

from pipeline.common.errors import BadInput

_IN_OUR_WORDS = {
    "extra_forbidden": "no such setting",
    "missing": "is missing",
    "list_type": "must be a list",
    "model_type": "must be settings by name",
}


def read_yaml(path: Path, what: str, refuse: Callable[[str], BadInput] = BadInput) -> Any:
    """The plain values of a YAML file, None of an empty one. Else what ``refuse`` makes of a sentence that begins with
    ``what`` is raised."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise refuse(f"{what}: not YAML: not a text file") from None
    except (OSError, ValueError) as error:
        raise refuse(f"{what}: cannot be read: {reason_of(error)}") from None
    return parse_yaml(text, what, refuse)


def parse_yaml(text: str, what: str, refuse: Callable[[str], BadInput] = BadInput) -> Any:
    """As ``read_yaml``, of a text."""
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise refuse(f"{what}: not YAML: nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a day that is in no calendar, a number without end
        raise refuse(f"{what}: not YAML: {str(error).splitlines()[0]}") from None


def given_path(text: str | Path, refuse: Callable[[str], BadInput] = BadInput) -> Path:
    """A path as a person typed it, ``~`` resolved. Else what ``refuse`` makes of a sentence is raised."""
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise refuse(f"{text}: unknown home directory") from None


def reason_of(error: Exception) -> str:
    """Why the system refused, in words."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__


def first_complaint(error: ValidationError, model: type[BaseModel]) -> str:
    """The first thing that is wrong with what should have been a ``model``, after where it stands; for a name that does
    not exist the one that was meant, if any is near. Of what is missing in one place all is named at once."""
    errors = error.errors()
    first = errors[0]
    place = first["loc"]
    missing = [each["loc"] for each in errors if each["type"] == "missing" and each["loc"][:-1] == place[:-1]]
    if first["type"] == "missing" and len(missing) > 1:
        return f"{', '.join('.'.join(map(str, each)) for each in missing)}: are missing"
    text = _IN_OUR_WORDS.get(first["type"], first["msg"].removeprefix("Value error, "))
    if first["type"] == "extra_forbidden":
        text += did_you_mean(str(place[-1]), _names_at(model, place[:-1]))
    where = ".".join(str(part) for part in place)
    return f"{where}: {text}" if where else text


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``; did you mean data_port?``, empty when no known name is near."""
    near = get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def _names_at(model: type[BaseModel], place: Iterable[int | str]) -> list[str]:
    """The settings that there are below a place."""
    below = [model]
    for part in place:
        fields = [above.model_fields[part] for above in below if part in above.model_fields]
        if fields:  # else it is a number in a list, or which kind of thing it was taken for
            below = [each for field in fields for each in _models_in(field.annotation)]
    return [name for each in below for name in each.model_fields]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """Those that a field may hold, alone or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in _models_in(each)]
