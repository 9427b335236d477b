"""JSON files of a batch's folder. Other machines write there, and disks fail, so each is checked when it is read."""

from __future__ import annotations

import json
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from app.fleet.store import Store
from pipeline.common.errors import BadInput

Content = TypeVar("Content")


def read_json(store: Store, name: str, expected: TypeAdapter[Content]) -> Content | None:
    """The content of a file; None where there is none. Raises BadInput if it is not as expected."""
    data = store.read(name)
    if data is None:
        return None
    try:
        return expected.validate_python(json.loads(data))  # a file's name, as text, need not be valid Unicode
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise BadInput(f"{store.address}/{name}: damaged: {f'{place}: ' if place else ''}{first['msg']}") from None
    except (ValueError, RecursionError):
        raise BadInput(f"{store.address}/{name}: damaged: not valid JSON") from None
