"""Reads files of unknown content, with one clear error whatever they contain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from pipeline.common.errors import BadInput
from pipeline.common.user_files import read_regular

_LARGEST_BYTES = 1 << 30
T = TypeVar("T")


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises BadInput if it cannot be read or is too large for labels."""
    try:
        return read_regular(path, _LARGEST_BYTES)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def parse_json(data: bytes, what: str) -> Any:
    """JSON without NaN and infinity. BadInput, beginning with ``what``, when it is none or nested too deep."""
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else str(error)
        raise BadInput(f"{what}: not JSON: {reason}") from None


def parse_as(adapter: TypeAdapter[T], data: bytes, what: str) -> T:
    """JSON of a known form. BadInput, beginning with ``what``, names the first field that is wrong."""
    return fit(adapter, parse_json(data, what), what)


def fit(adapter: TypeAdapter[T], value: Any, what: str) -> T:
    """A value that JSON gave, as a known form. BadInput as of ``parse_as``."""
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise BadInput(f"{what}: {where}: {first['msg']}") from None
    except RecursionError:
        raise BadInput(f"{what}: nested too deep") from None


def _refuse(word: str) -> Any:
    raise ValueError(f"{word} is not a number")
