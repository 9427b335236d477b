"""An image box follows its cuboid unless it was set; truncation and occlusion have a place."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Boxes of imported labels count as set; for others this is unknown, and they follow the cuboid."""
    op.add_column("sighting", sa.Column("box_set", sa.Boolean, nullable=False, server_default=sa.false()))
    op.add_column("sighting", sa.Column("truncation", sa.Double))
    op.add_column("sighting", sa.Column("occlusion", sa.Integer))
    item = sa.table("item", *map(sa.column, ("drive_id", "kind", "id", "value")))
    sighting = sa.table("sighting", *map(sa.column, ("drive_id", "track", "x1_px")), sa.column("box_set", sa.Boolean))
    imported = (
        sa.select(item.c.id)
        .where(item.c.drive_id == sighting.c.drive_id, item.c.id == sighting.c.track, item.c.kind == "track")
        .where(sa.or_(item.c.value.like('%"maker":"import"%'), item.c.value.like('%"maker": "import"%')))
    )
    op.execute(sighting.update().where(sighting.c.x1_px.is_not(None), imported.exists()).values(box_set=sa.true()))
