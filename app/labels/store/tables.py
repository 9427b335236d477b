"""The database tables of labels: drives, acts, the changes of each act, and the current labels.

``item`` and ``sighting`` are the current labels. ``act`` is the log, with one row per act; ``change`` holds every item
that an act changed, before and after, so that every act can be undone and every item has a history.
"""

from __future__ import annotations

from sqlalchemy import BigInteger, Boolean, Double, ForeignKey, Index, Integer, LargeBinary, String, Text, false
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from app.labels.store.values import LONGEST_ITEM, LONGEST_NAME


class Base(DeclarativeBase):
    """Base class of all tables."""


class DriveRow(Base):
    """A recording that was labelled or opened. key: derived from its content. count: number of frames, 0 for a source
    without frames, such as live sensors. revision: the number of its newest act."""

    __tablename__ = "drive"
    id: Mapped[int] = mapped_column(Integer, primary_key=True)
    key: Mapped[str] = mapped_column(String(LONGEST_ITEM), unique=True)
    uri: Mapped[str] = mapped_column(Text)
    title: Mapped[str] = mapped_column(Text)
    count: Mapped[int] = mapped_column(Integer)
    revision: Mapped[int] = mapped_column(BigInteger, default=0)


class ItemRow(Base):
    """A track (without its sightings), lead range, path, event or tag range. revision: the last act that changed it.
    Removed items keep their rows, so that others see the removal and ids are not reused."""

    __tablename__ = "item"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    kind: Mapped[str] = mapped_column(String(16), primary_key=True)
    id: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    revision: Mapped[int] = mapped_column(BigInteger)
    removed: Mapped[bool] = mapped_column(Boolean)
    value: Mapped[str] = mapped_column(Text)
    __table_args__ = (Index("item_by_revision", "drive_id", "revision"),)


class SightingRow(Base):
    """A track in one frame. Ego frame, metres, radians; box in pixels; None if there is none. The other columns are
    those of a ``Sighting``."""

    __tablename__ = "sighting"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    frame: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    track: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    keyframe: Mapped[bool] = mapped_column(Boolean)
    x_m: Mapped[float | None] = mapped_column(Double)
    y_m: Mapped[float | None] = mapped_column(Double)
    z_m: Mapped[float | None] = mapped_column(Double)
    length_m: Mapped[float | None] = mapped_column(Double)
    width_m: Mapped[float | None] = mapped_column(Double)
    height_m: Mapped[float | None] = mapped_column(Double)
    yaw_rad: Mapped[float | None] = mapped_column(Double)
    x1_px: Mapped[float | None] = mapped_column(Double)
    y1_px: Mapped[float | None] = mapped_column(Double)
    x2_px: Mapped[float | None] = mapped_column(Double)
    y2_px: Mapped[float | None] = mapped_column(Double)
    box_set: Mapped[bool] = mapped_column(Boolean, server_default=false())
    truncation: Mapped[float | None] = mapped_column(Double)
    occlusion: Mapped[int | None] = mapped_column(Integer)
    __table_args__ = (Index("sighting_by_track", "drive_id", "track", "frame", "keyframe"),)


class ActRow(Base):
    """An act of a person. number: from 1, per drive. step: the act that this one continues, else itself; they are
    undone together. station: the server whose parameters it changed. status: done, undone (can be redone) or dropped
    (undone, followed by another act). target: for an undo or redo, the step concerned. act_id: chosen by the client, so
    that a repeated request is not executed twice. note: additional information."""

    __tablename__ = "act"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    number: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(24))
    what: Mapped[str] = mapped_column(Text)
    person: Mapped[str] = mapped_column(String(LONGEST_NAME))
    station: Mapped[str] = mapped_column(Text)
    t_unix_ms: Mapped[int] = mapped_column(BigInteger)
    step: Mapped[int] = mapped_column(BigInteger)
    status: Mapped[str] = mapped_column(String(8))
    target: Mapped[int | None] = mapped_column(BigInteger)
    act_id: Mapped[str | None] = mapped_column(String(36))
    note: Mapped[str] = mapped_column(Text, server_default="")
    __table_args__ = (
        Index("act_by_status", "drive_id", "status", "person", "step"),
        Index("act_by_id", "drive_id", "act_id", unique=True),
    )


class ChangeRow(Base):
    """One item in one act: compressed JSON before and after, null if it did not exist. item: the id of an item, or a
    parameter's name."""

    __tablename__ = "change"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    act: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(16), primary_key=True)
    item: Mapped[str] = mapped_column(String(LONGEST_ITEM), primary_key=True)
    before: Mapped[bytes | None] = mapped_column(LargeBinary)
    after: Mapped[bytes | None] = mapped_column(LargeBinary)
    __table_args__ = (Index("change_by_item", "drive_id", "kind", "item", "act"),)


class VersionRow(Base):
    """A label set that was frozen under a name: the native file, compressed. sha256: digest of all columns and of the
    previous version (``previous``), empty for versions from before the chain existed; signature: signature of the
    digest by the public key ``signed_by``, both empty if it is not signed; see ``version_chain``."""

    __tablename__ = "version"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    name: Mapped[str] = mapped_column(String(LONGEST_NAME), primary_key=True)
    person: Mapped[str] = mapped_column(String(LONGEST_NAME))
    t_unix_ms: Mapped[int] = mapped_column(BigInteger)
    tracks: Mapped[int] = mapped_column(Integer)
    frames: Mapped[int] = mapped_column(Integer)
    labels: Mapped[bytes] = mapped_column(LargeBinary)
    previous: Mapped[str] = mapped_column(String(64), server_default="")
    sha256: Mapped[str] = mapped_column(String(64), server_default="")
    signed_by: Mapped[str] = mapped_column(String(64), server_default="")
    signature: Mapped[str] = mapped_column(String(128), server_default="")


class NewestVersionRow(Base):
    """Digest of the version that was frozen last, so that its removal is noticed; signed as a version is."""

    __tablename__ = "newest_version"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    sha256: Mapped[str] = mapped_column(String(64))
    signed_by: Mapped[str] = mapped_column(String(64), server_default="")
    signature: Mapped[str] = mapped_column(String(128), server_default="")


class WorkRow(Base):
    """Who labels a recording (empty if unassigned), and its state; see ``work.State``. t_unix_ms: time of the last
    change."""

    __tablename__ = "work"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    person: Mapped[str] = mapped_column(String(LONGEST_NAME))
    state: Mapped[str] = mapped_column(String(16))
    t_unix_ms: Mapped[int] = mapped_column(BigInteger)


class ProjectRow(Base):
    """A project. classes: its class list as YAML, empty for the server's. sampling: its rule in words, empty for none.
    person, t_unix_ms: who changed it last, and when."""

    __tablename__ = "project"
    name: Mapped[str] = mapped_column(String(LONGEST_NAME), primary_key=True)
    classes: Mapped[str] = mapped_column(Text)
    sampling: Mapped[str] = mapped_column(Text)
    person: Mapped[str] = mapped_column(String(LONGEST_NAME))
    t_unix_ms: Mapped[int] = mapped_column(BigInteger)


class ProjectDriveRow(Base):
    """A recording of a project; it is in one at most, because it has one class list."""

    __tablename__ = "project_drive"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    project: Mapped[str] = mapped_column(ForeignKey("project.name"))


class ControlRow(Base):
    """Frames whose truth is known, first … last. truth: a native file with the labels of these frames, compressed."""

    __tablename__ = "control"
    drive_id: Mapped[int] = mapped_column(ForeignKey("drive.id"), primary_key=True)
    first: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    last: Mapped[int] = mapped_column(Integer)
    truth: Mapped[bytes] = mapped_column(LargeBinary)
