"""The labels of one recording in a database: all of them, parts of them, and frozen versions."""

from __future__ import annotations

import hashlib
import time
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, cast

from sqlalchemy import and_, func, select

from app.labels.errors import ActRefused, NoSuchLabel
from app.labels.store.act_log import Log
from app.labels.store.authors import read_authors
from app.labels.store.database import Database
from app.labels.store.items import (
    SIGHTINGS,
    read_changed,
    read_extents,
    read_item,
    read_items,
    read_track,
    read_window,
)
from app.labels.store.tables import DriveRow, ItemRow, ProjectDriveRow, ProjectRow, SightingRow, VersionRow
from app.labels.store.values import KINDS, LONGEST_ITEM, Item, ItemKind, sighting_of
from app.labels.store.version_chain import chained, check, note_newest, removed
from app.labels.wording import WORKING
from pipeline.labels.classes import ClassList, parse_classes
from pipeline.labels.formats.native import from_json, to_json
from pipeline.labels.model import EventLabel, FrameTag, LabelSet, LabelTrack, LeadRange, PathLabel, Sighting
from pipeline.sources.fingerprint import content_key
from pipeline.types.source import Source


@dataclass(frozen=True)
class DriveInfo:
    """A recording that labels belong to."""

    key: str
    """Derived from its content, so that a moved file keeps its labels."""
    uri: str
    """As it was opened."""
    title: str
    """Shown to people."""
    t_ns: tuple[int, ...]
    """Ticks of its frames."""
    names: Callable[[], tuple[str, ...]]
    """Returns the names of its frames; may read all frames."""


def info_of(source: Source, names: Callable[[], tuple[str, ...]]) -> DriveInfo:
    """Identifies a recording independently of its location: three of its frames are read."""
    t_ns = tuple(source.t_ns(index) for index in range(len(source)))
    return DriveInfo(content_key(t_ns, source.frame), source.uri, source.title, t_ns, names)


def info_of_uri(uri: str) -> DriveInfo:
    """For a source without frames, such as live sensors, which has no content to identify it. The key is short enough
    for the database; two addresses never share one."""
    key = f"uri {uri}"
    short = key if len(key) <= LONGEST_ITEM else f"uri sha256 {hashlib.sha256(uri.encode()).hexdigest()}"
    return DriveInfo(short, uri, uri, (), tuple)


@dataclass(frozen=True)
class Version:
    """A frozen label set."""

    name: str
    """Unique within the drive."""
    person: str
    """Who froze it."""
    t_unix_ms: int
    """When, in Unix milliseconds, by the clock of the writing program."""
    tracks: int
    """Number of labelled vehicles."""
    frames: int
    """Number of labelled frames."""
    signed_by: str = ""
    """The public key that it is signed with, 64 hexadecimal digits; empty where it is not signed."""


@dataclass(frozen=True)
class LabelSetChanges:
    """Changes by the acts after a revision."""

    revision: int
    """The newest revision; the start of the next request."""
    items: list[Item]
    """Added or changed items, in their current state."""
    removed: list[tuple[ItemKind, int]]
    """Kind and id of each removed item."""
    extents: dict[int, tuple[int, int, int, list[int]]]
    """By track: first and last frame, number of sightings, keyframes."""
    authors: dict[tuple[ItemKind, int], str]
    """Who cannot review the items, by kind and id; see ``read_authors``."""


class DriveLabels:
    """Any thread. Everything is read from the database on each call, because others write to it as well."""

    def __init__(self, database: Database, info: DriveInfo, station: str | None = None) -> None:
        """Finds the recording by its content, or adds it without labels."""
        self.info, self._database = info, database
        self._id = _drive_row(database, info)
        self.log = Log(database, self._id, station)

    @property
    def revision(self) -> int:
        """The number of the newest act."""
        with self._database.reading() as connection:
            return connection.scalars(select(DriveRow.revision).where(DriveRow.id == self._id)).one()

    def changes(self, since: int = 0) -> LabelSetChanges:
        with self._database.reading() as connection:
            revision = connection.scalars(select(DriveRow.revision).where(DriveRow.id == self._id)).one()
            items, removed = read_changed(connection, self._id, since)
            tracks = [item.id for item in items if item.kind == "track"]
            extents = read_extents(connection, self._id, tracks) if tracks else {}
            authors = read_authors(connection, self._id, items)
        return LabelSetChanges(revision, items, removed if since else [], extents, authors)

    def window(self, first: int, last: int) -> tuple[int, dict[int, list[tuple[int, Sighting]]]]:
        """(revision, for each frame its tracks and their sightings)."""
        found: dict[int, list[tuple[int, Sighting]]] = {}
        with self._database.reading() as connection:
            revision = connection.scalars(select(DriveRow.revision).where(DriveRow.id == self._id)).one()
            for track, sighting in read_window(connection, self._id, first, last):
                found.setdefault(sighting.frame, []).append((track, sighting))
        return revision, found

    def items(self, kind: ItemKind) -> dict[int, Item]:
        with self._database.reading() as connection:
            return read_items(connection, self._id, kind)

    def authors(self, items: Iterable[Item] | None = None) -> dict[tuple[ItemKind, int], str]:
        """Who cannot review these items, by kind and id; see ``read_authors``. items: None for all."""
        with self._database.reading() as connection:
            of = read_changed(connection, self._id, 0)[0] if items is None else items
            return read_authors(connection, self._id, of)

    def classes(self) -> ClassList | None:
        """The class list of the recording's project; None if it has none."""
        with self._database.reading() as connection:
            text = connection.scalars(
                select(ProjectRow.classes)
                .join(ProjectDriveRow, ProjectDriveRow.project == ProjectRow.name)
                .where(ProjectDriveRow.drive_id == self._id)
            ).first()
        return parse_classes(text, "the project's classes") if text else None

    def track(self, number: int) -> Item:
        """With its sightings. NoSuchLabel if it does not exist."""
        with self._database.reading() as connection:
            found = read_item(connection, self._id, "track", number)
            if found is None:
                raise NoSuchLabel(f"there is no track {number}")
            sightings = tuple(read_track(connection, self._id, number).values())
        return replace(found, value=replace(cast("LabelTrack", found.value), sightings=sightings))

    def label_set(self, version: str = WORKING) -> LabelSet:
        """All labels, current or of a frozen version. NoSuchLabel if the version does not exist."""
        if version != WORKING:
            return from_json(self.version_json(version), f"version {version}")
        return self._now(self.info.names())

    def unnamed_set(self) -> LabelSet:
        """The current labels with frame numbers as names, so that no frame is read."""
        return self._now(tuple(map(str, range(len(self.info.t_ns)))))

    def has_labels(self) -> bool:
        """Whether there are any labels."""
        return any(self.items(kind) for kind in KINDS)

    # ------------------------------------------------------------ versions

    def versions(self) -> list[Version]:
        """All versions, oldest first."""
        with self._database.reading() as connection:
            found = connection.execute(
                select(*(getattr(VersionRow, each.name) for each in fields(Version)))
                .where(VersionRow.drive_id == self._id)
                .order_by(VersionRow.t_unix_ms, VersionRow.name)
            ).all()
        return [Version(*row) for row in found]

    def freeze(self, name: str, person: str) -> Version:
        """Store all current labels under a name. ActRefused if it is taken."""
        taken = f"version {name!r} already exists; versions are never overwritten"
        if name == WORKING or any(version.name == name for version in self.versions()):
            raise ActRefused(taken)
        labels = replace(self.label_set(), name=name)
        covered = {each.frame for track in labels.tracks for each in track.sightings}
        covered |= {frame for lead in labels.leads for frame in range(lead.first, lead.last + 1)}
        frozen_ms = int(time.time() * 1000)
        values = {
            "drive_id": self._id,
            "name": name,
            "person": person,
            "t_unix_ms": frozen_ms,
            "tracks": len(labels.tracks),
            "frames": len(covered),
            "labels": zlib.compress(to_json(labels), 1),
        }
        with self._database.writing() as connection:
            row = chained(connection, values)
            if not self._database.insert_new(connection, VersionRow, row):
                raise ActRefused(taken)  # somebody else used the name at the same moment
            note_newest(connection, row)
        return Version(**{each.name: row[each.name] for each in fields(Version)})

    def version_json(self, name: str) -> bytes:
        """The native file of a frozen version. NoSuchLabel if it does not exist, ActRefused if it has been altered."""
        with self._database.reading() as connection:
            row = connection.execute(
                select(VersionRow.__table__).where(VersionRow.drive_id == self._id, VersionRow.name == name)
            ).first()
            if row is None:
                gone = "; the newest version was removed from the database" if removed(connection, self._id) else ""
                raise NoSuchLabel(f"there is no version {name!r} of these labels{gone}")
            check(connection, row)
        return zlib.decompress(row.labels)

    # ------------------------------------------------------------ internal

    def _now(self, names: tuple[str, ...]) -> LabelSet:
        by_track: dict[int, list[Sighting]] = {}
        with self._database.reading() as connection:
            rows = connection.execute(
                select(*SIGHTINGS).where(SightingRow.drive_id == self._id).order_by(SightingRow.frame)
            )
            for row in rows:
                by_track.setdefault(row[2], []).append(sighting_of(row))
            items = {kind: [each.value for each in read_items(connection, self._id, kind).values()] for kind in KINDS}
        tracks = cast("list[LabelTrack]", items["track"])
        leads = sorted(cast("list[LeadRange]", items["lead"]), key=lambda lead: (lead.first, lead.last))
        return LabelSet(
            self.info.uri,
            names,
            self.info.t_ns,
            tuple(replace(track, sightings=tuple(by_track.get(track.id, ()))) for track in tracks),
            tuple(leads),
            tuple(sorted(cast("list[PathLabel]", items["path"]), key=lambda path: path.frame)),
            tuple(sorted(cast("list[EventLabel]", items["event"]), key=lambda event: event.frame)),
            tuple(sorted(cast("list[FrameTag]", items["tag"]), key=lambda tag: (tag.first, tag.last))),
        )


def known_drives(database: Database) -> list[dict[str, Any]]:
    """Every recording with labels: its uri, title, number of frames and tracks, and newest act."""
    tracks = func.count(ItemRow.id).filter(ItemRow.kind == "track")
    with database.reading() as connection:
        found = connection.execute(
            select(DriveRow.uri, DriveRow.title, DriveRow.count, tracks.label("tracks"), DriveRow.revision)
            .join(ItemRow, and_(ItemRow.drive_id == DriveRow.id, ItemRow.removed.is_(False)))
            .where(DriveRow.count > 0)
            .group_by(DriveRow.id)
            .order_by(DriveRow.title, DriveRow.id)
        ).all()
    return [dict(row._mapping) for row in found]


def _drive_row(database: Database, info: DriveInfo) -> int:
    """Its id; created if it does not exist. Concurrent calls create only one."""
    values = {
        "key": info.key,
        "uri": info.uri,
        "title": info.title,
        "count": len(info.t_ns),
        "revision": 0,
    }
    wanted = select(DriveRow.id).where(DriveRow.key == info.key)
    with database.reading() as connection:
        found = connection.scalars(wanted).first()
    if found is not None:
        return found
    with database.writing() as connection:
        database.insert_new(connection, DriveRow, values)
        return connection.scalars(wanted).one()
