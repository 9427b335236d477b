"""Projects: sets of recordings with classes and a sampling, and frames whose truth is known."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """A recording without a row is in no project."""
    op.create_table(
        "project",
        sa.Column("name", sa.String(80), primary_key=True),
        sa.Column("classes", sa.Text, nullable=False),
        sa.Column("sampling", sa.Text, nullable=False),
        sa.Column("person", sa.String(80), nullable=False),
        sa.Column("t_unix_ms", sa.BigInteger, nullable=False),
    )
    op.create_table(
        "project_drive",
        sa.Column("drive_id", sa.Integer, sa.ForeignKey("drive.id"), primary_key=True),
        sa.Column("project", sa.String(80), sa.ForeignKey("project.name"), nullable=False),
    )
    op.create_table(
        "control",
        sa.Column("drive_id", sa.Integer, sa.ForeignKey("drive.id"), primary_key=True),
        sa.Column("first", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("last", sa.Integer, nullable=False),
        sa.Column("truth", sa.LargeBinary, nullable=False),
    )
