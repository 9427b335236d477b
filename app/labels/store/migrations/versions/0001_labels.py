"""Drives, acts and their changes, items, sightings, versions."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

_METRES = ("x_m", "y_m", "z_m", "length_m", "width_m", "height_m", "yaw_rad")
_PIXELS = ("x1_px", "y1_px", "x2_px", "y2_px")


def _drive() -> sa.Column[int]:
    return sa.Column("drive_id", sa.Integer, sa.ForeignKey("drive.id"), primary_key=True)


def _number(name: str, kind: type[sa.Integer] = sa.BigInteger) -> sa.Column[int]:
    return sa.Column(name, kind, primary_key=True, autoincrement=False)


def upgrade() -> None:
    """Create all tables."""
    op.create_table(
        "drive",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("key", sa.String(120), nullable=False, unique=True),
        sa.Column("uri", sa.Text, nullable=False),
        sa.Column("title", sa.Text, nullable=False),
        sa.Column("count", sa.Integer, nullable=False),
        sa.Column("revision", sa.BigInteger, nullable=False),
    )
    op.create_table(
        "item",
        _drive(),
        sa.Column("kind", sa.String(16), primary_key=True),
        _number("id"),
        sa.Column("revision", sa.BigInteger, nullable=False),
        sa.Column("removed", sa.Boolean, nullable=False),
        sa.Column("value", sa.Text, nullable=False),
    )
    op.create_index("item_by_revision", "item", ["drive_id", "revision"])
    op.create_table(
        "sighting",
        _drive(),
        _number("frame", sa.Integer),
        _number("track"),
        sa.Column("keyframe", sa.Boolean, nullable=False),
        *(sa.Column(name, sa.Double) for name in (*_METRES, *_PIXELS)),
    )
    op.create_index("sighting_by_track", "sighting", ["drive_id", "track", "frame", "keyframe"])
    op.create_table(
        "act",
        _drive(),
        _number("number"),
        sa.Column("kind", sa.String(24), nullable=False),
        sa.Column("what", sa.Text, nullable=False),
        sa.Column("person", sa.String(80), nullable=False),
        sa.Column("station", sa.Text, nullable=False),
        sa.Column("t_unix_ms", sa.BigInteger, nullable=False),
        sa.Column("step", sa.BigInteger, nullable=False),
        sa.Column("status", sa.String(8), nullable=False),
        sa.Column("target", sa.BigInteger),
    )
    op.create_index("act_by_status", "act", ["drive_id", "status", "person", "step"])
    op.create_table(
        "change",
        _drive(),
        _number("act"),
        sa.Column("kind", sa.String(16), primary_key=True),
        sa.Column("item", sa.String(120), primary_key=True),
        sa.Column("before", sa.LargeBinary),
        sa.Column("after", sa.LargeBinary),
    )
    op.create_index("change_by_item", "change", ["drive_id", "kind", "item", "act"])
    op.create_table(
        "version",
        _drive(),
        sa.Column("name", sa.String(80), primary_key=True),
        sa.Column("person", sa.String(80), nullable=False),
        sa.Column("t_unix_ms", sa.BigInteger, nullable=False),
        sa.Column("tracks", sa.Integer, nullable=False),
        sa.Column("frames", sa.Integer, nullable=False),
        sa.Column("labels", sa.LargeBinary, nullable=False),
    )
