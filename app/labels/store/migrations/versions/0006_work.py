"""Who labels a recording, and how far that is."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """A recording without a row is open and unassigned."""
    op.create_table(
        "work",
        sa.Column("drive_id", sa.Integer, sa.ForeignKey("drive.id"), primary_key=True),
        sa.Column("person", sa.String(80), nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("t_unix_ms", sa.BigInteger, nullable=False),
    )
