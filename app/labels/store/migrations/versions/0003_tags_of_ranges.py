"""A tag is of a range of frames; it was of one."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

from app.labels.store.values import pack, unpack
from pipeline.labels.formats.native import as_range

revision = "0003"
down_revision = "0002"

_ITEM = sa.table("item", *map(sa.column, ("drive_id", "kind", "id", "value")))
_BLOBS = (sa.column("before", sa.LargeBinary), sa.column("after", sa.LargeBinary))
_CHANGE = sa.table("change", *map(sa.column, ("drive_id", "act", "kind", "item")), *_BLOBS)


def upgrade() -> None:
    """Migrates current items, and the contents before and after every act."""
    _rewrite(_ITEM, ("drive_id", "kind", "id"), {"value": lambda value: json.dumps(as_range(json.loads(value)))})
    _rewrite(_CHANGE, ("drive_id", "act", "kind", "item"), {"before": _content, "after": _content})


def _rewrite(table: sa.TableClause, key: tuple[str, ...], how: dict[str, Callable[[Any], Any]]) -> None:
    connection = op.get_bind()
    for row in connection.execute(sa.select(table).where(table.c.kind == "tag")).all():
        new = {name: each(getattr(row, name)) for name, each in how.items()}
        here = sa.and_(*(table.c[name] == getattr(row, name) for name in key))
        connection.execute(table.update().where(here).values(new))


def _content(data: bytes | None) -> bytes | None:
    """None if the tag did not exist."""
    if data is None:
        return None
    body = unpack(data)
    return pack({**body, "value": as_range(body["value"])})
