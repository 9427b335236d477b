"""The newest version of each recording is stored apart, so that its removal is noticed."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    newest = op.create_table(
        "newest_version",
        sa.Column("drive_id", sa.Integer, sa.ForeignKey("drive.id"), primary_key=True),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("signed_by", sa.String(64), nullable=False, server_default=""),
        sa.Column("signature", sa.String(128), nullable=False, server_default=""),
    )
    version = sa.table("version", sa.column("drive_id"), sa.column("previous"), sa.column("sha256"))
    rows = op.get_bind().execute(sa.select(version).where(version.c.sha256 != "")).all()
    followed = {(row.drive_id, row.previous) for row in rows}
    ends = {row.drive_id: row.sha256 for row in rows if (row.drive_id, row.sha256) not in followed}
    op.bulk_insert(newest, [{"drive_id": drive_id, "sha256": sha256} for drive_id, sha256 in ends.items()])
