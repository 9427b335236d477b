"""Versions are chained by hash; those so far are not."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    for name in ("previous", "sha256"):
        op.add_column("version", sa.Column(name, sa.String(64), nullable=False, server_default=""))
