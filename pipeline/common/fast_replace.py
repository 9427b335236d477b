"""A fast ``dataclasses.replace``."""

from __future__ import annotations

from typing import Any, TypeVar

Record = TypeVar("Record")


def evolve(record: Record, **values: Any) -> Record:
    """``dataclasses.replace`` for the hot path. It copies the fields without calling ``__init__``, which takes a fifth
    of the time for a record of 25 fields; one frame makes about two hundred such calls.

    Only for frozen dataclasses without ``__slots__`` and ``__post_init__``. TypeError for an unknown field.
    """
    fields = record.__dict__.copy()
    known = len(fields)
    fields.update(values)
    if len(fields) != known:
        unknown = sorted(values.keys() - record.__dict__.keys())
        raise TypeError(f"{type(record).__name__} has no field {', '.join(unknown)}")
    changed = object.__new__(type(record))
    object.__setattr__(changed, "__dict__", fields)  # plain assignment raises in frozen records
    return changed
