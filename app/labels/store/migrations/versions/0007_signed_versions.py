"""Versions can be signed; those so far are not."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    for name, digits in (("signed_by", 64), ("signature", 128)):
        op.add_column("version", sa.Column(name, sa.String(digits), nullable=False, server_default=""))
