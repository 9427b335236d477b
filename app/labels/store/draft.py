"""An act in progress: labels are read and changed within its transaction, and written at the end."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence, Set
from typing import Any

from sqlalchemy import Connection, bindparam, delete, func, insert, select, tuple_

from app.labels.errors import ActRefused, NoSuchLabel, Stale
from app.labels.store.authors import read_authors
from app.labels.store.items import Change, read_changes_of_others, read_item, read_items, read_track
from app.labels.store.tables import ActRow, ChangeRow, ItemRow, SightingRow
from app.labels.store.values import (
    Content,
    Frames,
    Item,
    ItemKind,
    Value,
    pack,
    pack_content,
    row_of,
    value_to_json,
)
from pipeline.labels.model import LabelTrack, Sighting

_COLUMNS = tuple(column.name for column in SightingRow.__table__.columns)
_Key = tuple[ItemKind, int]


def name_of(kind: ItemKind, number: int) -> str:
    """Display name."""
    return f"#{number}" if kind == "track" else f"{kind} {number}"


class Draft:
    """Changes of one act, before they are written. number: number of the act. Reads include earlier changes."""

    def __init__(self, connection: Connection, drive_id: int, number: int, person: str, t_unix_ms: int) -> None:
        self.number, self.person, self.t_unix_ms = number, person, t_unix_ms
        self._connection, self._drive_id = connection, drive_id
        self._before: dict[_Key, Item | None] = {}
        self._after: dict[_Key, Value | None] = {}
        self._frames_before: dict[int, dict[int, Sighting | None]] = {}
        self._frames_after: dict[int, dict[int, Sighting | None]] = {}
        self._params: dict[str, tuple[Any, Any]] = {}
        self._given: dict[ItemKind, int] = {}
        self._tracks: set[int] | None = None
        """Ids of all tracks that ever existed; None until needed."""

    # ------------------------------------------------------------ reading

    def find(self, kind: ItemKind, number: int) -> Item | None:
        """The current item; None if it does not exist."""
        key = (kind, number)
        if key not in self._before:
            self._before[key] = read_item(self._connection, self._drive_id, kind, number)
        before = self._before[key]
        if key not in self._after:
            return before
        value = self._after[key]
        return Item(kind, number, before.revision if before is not None else 0, value) if value is not None else None

    def get(self, kind: ItemKind, number: int, revision: int | None = None) -> Item:
        """The current item. Stale if ``revision`` is given and somebody has changed or removed it since; NoSuchLabel if
        it never existed."""
        found = self.find(kind, number)
        if revision is None and found is not None:
            return found
        if found is None:
            removed_by = self._last_change(kind, number)
            if removed_by is None:
                raise NoSuchLabel(f"there is no {kind} {number}")
            raise Stale(
                f"{self.who(removed_by)} removed {name_of(kind, number)} since", kind, number, None, self.number - 1
            )
        if found.revision != revision and (kind, number) not in self._after:
            theirs = {"id": number, **value_to_json(kind, found.value), "revision": found.revision}
            raise Stale(
                f"{self.who(found.revision)} changed {name_of(kind, number)} since",
                kind,
                number,
                theirs,
                self.number - 1,
            )
        return found

    def all(self, kind: ItemKind) -> dict[int, Item]:
        """Every item of a kind, by its number."""
        stored = read_items(self._connection, self._drive_id, kind)
        for number, item in stored.items():
            self._before.setdefault((kind, number), item)
        numbers = {*stored, *(number for other, number in self._after if other == kind)}
        found = {number: self.find(kind, number) for number in sorted(numbers)}
        return {number: item for number, item in found.items() if item is not None}

    def sightings(self, track: int, first: int | None = None, last: int | None = None) -> dict[int, Sighting]:
        """Sightings of a track, by ascending frame."""
        found: dict[int, Sighting | None] = {}
        found.update(read_track(self._connection, self._drive_id, track, first, last))
        for frame, sighting in self._frames_after.get(track, {}).items():
            if (first is None or frame >= first) and (last is None or frame <= last):
                found[frame] = sighting
        return {frame: sighting for frame in sorted(found) if (sighting := found[frame]) is not None}

    def stands(self, kind: ItemKind, number: int, content: Content) -> bool:
        """Whether an item's current state is exactly this: its value, and for a track its sightings in those frames."""
        item, frames = self.find(kind, number), content.frames
        if (item.value if item is not None else None) != content.value:
            return False
        there = self.sightings(number, min(frames), max(frames)) if frames else {}
        return all(there.get(frame) == each for frame, each in frames.items())

    @property
    def touched(self) -> Set[tuple[ItemKind, int]]:
        """Kind and id of every item that was changed or removed."""
        return self._after.keys()

    # ------------------------------------------------------------ changing

    def put(self, kind: ItemKind, number: int, value: Value | None) -> None:
        """Change or create an item, or remove it with None; a removed track's sightings are removed as well."""
        self.find(kind, number)
        self._after[(kind, number)] = value
        if kind == "track" and value is None:
            self.put_sightings(number, dict.fromkeys(self.sightings(number)))

    def put_as_one(self, kind: ItemKind, numbers: Sequence[int], value: Value) -> None:
        """Replace these items by one, under the first one's id; a new item if there are none."""
        if not numbers:
            self.add(kind, value)
            return
        for number in numbers[1:]:
            self.put(kind, number, None)
        self.put(kind, numbers[0], value)

    def add(self, kind: ItemKind, value: Value) -> int:
        """Create an item; returns its id, which was never used before."""
        following = self.next_number(kind)
        number = value.id if isinstance(value, LabelTrack) else following
        self._given[kind] = max(following - 1, number)
        self.put(kind, number, value)
        return number

    def next_number(self, kind: ItemKind) -> int:
        """The first unused id."""
        if kind not in self._given:
            self._given[kind] = (
                self._connection.scalar(
                    select(func.max(ItemRow.id)).where(ItemRow.drive_id == self._drive_id, ItemRow.kind == kind)
                )
                or 0
            )
        return self._given[kind] + 1

    def number_for(self, track: LabelTrack) -> int:
        """A track's own id, unless another track has or had it, because the history would be mixed up."""
        if self._tracks is None:
            wanted = select(ItemRow.id).where(ItemRow.drive_id == self._drive_id, ItemRow.kind == "track")
            self._tracks = set(self._connection.scalars(wanted))
        is_given = track.id in self._tracks or ("track", track.id) in self._after
        return self.next_number("track") if is_given or track.id == 0 else track.id

    def put_sightings(self, track: int, frames: Frames) -> None:
        """Change some of a track's sightings; None removes one. The track itself counts as changed."""
        if not frames:
            return
        self.find("track", track)
        before = self._frames_before.setdefault(track, {})
        fresh = [frame for frame in frames if frame not in before]
        if fresh:
            stored = read_track(self._connection, self._drive_id, track, min(fresh), max(fresh))
            before.update({frame: stored.get(frame) for frame in fresh})
        self._frames_after.setdefault(track, {}).update(frames)

    def put_param(self, name: str, before: Any, after: Any) -> None:
        """Record a change of one of this program's parameters."""
        self._params[name] = (self._params.get(name, (before, None))[0], after)

    @property
    def params(self) -> Mapping[str, Any]:
        """New values of parameters, by name."""
        return {name: after for name, (_, after) in self._params.items()}

    # ------------------------------------------------------------ writing

    def write(self) -> bool:
        """Write everything that differs, with its changes. False if nothing differs."""
        items = {key: self._content(key) for key in {*self._after, *(("track", n) for n in self._frames_after)}}
        changed = {key: pair for key, pair in items.items() if pair[0] != pair[1]}
        self._write_items(changed)
        self._write_sightings(changed)
        rows: list[tuple[Any, ...]] = [
            (self._drive_id, self.number, kind, str(number), pack_content(kind, before), pack_content(kind, after))
            for (kind, number), (before, after) in changed.items()
        ]
        rows += [
            (self._drive_id, self.number, "param", name, pack(before), pack(after))
            for name, (before, after) in self._params.items()
            if before != after
        ]
        if rows:
            names = ("drive_id", "act", "kind", "item", "before", "after")
            self._connection.execute(insert(ChangeRow), [dict(zip(names, row, strict=True)) for row in rows])
        return bool(rows)

    def _last_change(self, kind: ItemKind, number: int) -> int | None:
        return self._connection.scalar(
            select(ItemRow.revision).where(
                ItemRow.drive_id == self._drive_id, ItemRow.kind == kind, ItemRow.id == number
            )
        )

    def author_of(self, item: Item) -> str:
        """Whose decision an item is, before this act; empty for nobody's. See ``read_authors``."""
        return read_authors(self._connection, self._drive_id, [item]).get((item.kind, item.id), "")

    def changes_of_others(self, kind: ItemKind, since: int) -> Iterator[Change]:
        """Changes by other persons' acts after ``since`` to items of a kind, by act."""
        return read_changes_of_others(self._connection, self._drive_id, kind, since, self.person)

    def who(self, act: int) -> str:
        """The person of an act."""
        person = self._connection.scalar(
            select(ActRow.person).where(ActRow.drive_id == self._drive_id, ActRow.number == act)
        )
        return person or "somebody"

    def _content(self, key: _Key) -> tuple[Content, Content]:
        """Before and after, with the frames that differ."""
        kind, number = key
        item = self._before[key]
        before = item.value if item is not None else None
        after = self._after.get(key, before)
        if kind != "track":
            return Content(before, {}), Content(after, {})
        if after is None and before is None:
            raise ActRefused(f"sightings of track {number}, which does not exist")
        was, now = self._frames_before.get(number, {}), self._frames_after.get(number, {})
        frames = [frame for frame in now if was[frame] != now[frame]]
        return Content(before, {f: was[f] for f in frames}), Content(after, {f: now[f] for f in frames})

    def _write_items(self, changed: Mapping[_Key, tuple[Content, Content]]) -> None:
        rows = []
        for (kind, number), (before, after) in changed.items():
            value = after.value if after.value is not None else before.value
            assert value is not None
            body = json.dumps(value_to_json(kind, value), separators=(",", ":"), ensure_ascii=False)
            rows.append((self._drive_id, kind, number, self.number, after.value is None, body))
        if not rows:
            return
        keys = [(row[1], row[2]) for row in rows]
        for start in range(0, len(keys), 200):
            some = keys[start : start + 200]
            self._connection.execute(
                delete(ItemRow).where(ItemRow.drive_id == self._drive_id, tuple_(ItemRow.kind, ItemRow.id).in_(some))
            )
        names = ("drive_id", "kind", "id", "revision", "removed", "value")
        self._connection.execute(insert(ItemRow), [dict(zip(names, row, strict=True)) for row in rows])

    def _write_sightings(self, changed: Mapping[_Key, tuple[Content, Content]]) -> None:
        """For all tracks at once: with one statement per track, this would dominate the time of an import."""
        gone, rows = [], []
        for (kind, track), (before, after) in changed.items():
            if kind == "track":
                gone += [(frame, track) for frame, each in before.frames.items() if each is not None]
                rows += [row_of(self._drive_id, track, each) for each in after.frames.values() if each is not None]
        if gone:
            one = delete(SightingRow).where(
                SightingRow.drive_id == self._drive_id,
                SightingRow.frame == bindparam("at_frame"),
                SightingRow.track == bindparam("of_track"),
            )
            self._connection.execute(one, [{"at_frame": frame, "of_track": track} for frame, track in gone])
        if rows:
            self._connection.execute(insert(SightingRow), [dict(zip(_COLUMNS, row, strict=True)) for row in rows])
