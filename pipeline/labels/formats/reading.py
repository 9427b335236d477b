"""Reads files of unknown content, with one clear error whatever they contain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import read_regular

_LARGEST_BYTES = 1 << 30
T = TypeVar("T")


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises BadInput if it cannot be read or is too large for labels."""
    try:
        return read_regular(path, _LARGEST_BYTES)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def parse_json(data: bytes, what: str) -> Any:
    """JSON without NaN and infinity. BadInput, beginning with ``what``, if it is invalid or nested too deeply."""
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else str(error)
        raise BadInput(f"{what}: not JSON: {reason}") from None


def parse_as(adapter: TypeAdapter[T], data: bytes, what: str) -> T:
    """Parse and validate JSON. BadInput, beginning with ``what``, names the first invalid field."""
    return fit(adapter, parse_json(data, what), what)


def fit(adapter: TypeAdapter[T], value: Any, what: str) -> T:
    """Validate a value parsed from JSON. Raises the same error as ``parse_as``."""
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
