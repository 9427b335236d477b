"""Acts have an id of who sent them, and the note they were answered with. A station is a server, not its machine."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """So far, nearly all servers used the default port."""
    op.add_column("act", sa.Column("act_id", sa.String(36)))
    op.add_column("act", sa.Column("note", sa.Text, nullable=False, server_default=""))
    op.create_index("act_by_id", "act", ["drive_id", "act_id"], unique=True)
    act = sa.table("act", sa.column("station", sa.Text))
    op.execute(act.update().values(station=act.c.station + ":8420"))
