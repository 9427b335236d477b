"""The lead of each frame as a table for spreadsheets, with one row per frame, including frames whose lead is not
labelled.

``lead`` is a track's number, ``none`` or ``unknown``, and empty where it is not labelled. ``label``, ``distance_m``
(from the ego origin to the cuboid's nearest point, horizontally) and ``x_m y_m`` (its centre, ego frame) are for
readers and are not imported. Adjacent ranges with the same lead become one.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

from pydantic import TypeAdapter

from pipeline.common.errors import BadInput
from pipeline.common.geometry import closest_on_polygon
from pipeline.labels.formats.base import Imported, LabeledDrive, write_file
from pipeline.labels.formats.reading import fit, read_bytes
from pipeline.labels.model import LabelSet, Lead, LeadRange, Maker, Origin, State

_TOLD = (
    "frame", "name", "t_ns", "lead", "state", "maker", "by", "made_unix_ms", "params", "calibration", "how", "comment",
    "reviewer",
)  # fmt: skip
_COLUMNS = (*_TOLD, "label", "distance_m", "x_m", "y_m")
_LONGEST_NUMBER = 20
_STATE: TypeAdapter[State] = TypeAdapter(State)
_MAKER: TypeAdapter[Maker] = TypeAdapter(Maker)


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(_COLUMNS)
    told = [each for each in labels.leads if each.state != "rejected"]
    for index, shot in enumerate(drive.shots):
        said = next((each for each in told if each.first <= index <= each.last), None)
        rows.writerow((index, shot.name, shot.t_ns, *_said(said), *_seen(labels, said, index)))
    write_file(out, text.getvalue().encode())
    rejected = len(labels.leads) - len(told)
    return (f"{rejected:,} rejected ranges of the lead left out: a frame has one lead here",) if rejected else ()


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    data = read_bytes(path).decode("utf-8-sig", "replace")
    found: dict[int, LeadRange | None] = {}
    try:
        rows = csv.DictReader(io.StringIO(data, newline=""), strict=True)
        if not {"frame", "lead"} <= set(rows.fieldnames or ()):
            raise BadInput(f"{path}: a lead table needs at least the columns frame and lead")
        for row in rows:
            what = f"{path}, line {rows.line_num}"
            frame = _frame(row, drive, what)
            if frame in found:
                raise BadInput(f"{what}: frame {frame} occurs twice")
            found[frame] = _range(row, frame, origin, what)
    except csv.Error as error:
        raise BadInput(f"{path}: not a CSV table: {error}") from None
    leads = _joined([each for _, each in sorted(found.items()) if each is not None])
    return Imported(replace(drive.empty(), leads=tuple(leads)))


def _said(lead: LeadRange | None) -> tuple[str | int, ...]:
    if lead is None:
        return ("",) * (len(_TOLD) - 3)
    by = lead.origin
    made = (by.maker, by.name, by.t_unix_ms, by.params or "", by.calibration or "", by.how)
    return lead.lead, lead.state, *made, lead.comment, lead.reviewer


def _seen(labels: LabelSet, lead: LeadRange | None, index: int) -> tuple[str, ...]:
    """Class, distance and position of the lead in a frame; empty if unknown."""
    track = next((each for each in labels.tracks if lead is not None and each.id == lead.lead), None)
    sighting = track.at(index) if track is not None else None
    if track is None or sighting is None or sighting.cuboid is None:
        return (track.label if track is not None else "", "", "", "")
    distance_m = math.hypot(*closest_on_polygon(sighting.cuboid.footprint()))
    x, y, _ = sighting.cuboid.center
    return track.label, f"{distance_m:.3f}", f"{x:.3f}", f"{y:.3f}"


def _frame(row: dict[str, str], drive: LabeledDrive, what: str) -> int:
    frame = _whole(row["frame"], what)
    if not 0 <= frame < len(drive.shots):
        raise BadInput(f"{what}: frame {frame} of {len(drive.shots)}")
    if row.get("name") not in (None, "", drive.shots[frame].name):
        raise BadInput(f"{what}: frame {frame} of this recording has another name: {drive.shots[frame].name}")
    return frame


def _range(row: dict[str, str], frame: int, origin: Origin, what: str) -> LeadRange | None:
    """One row as a range of one frame; None if no lead is labelled."""
    text = (row["lead"] or "").strip()
    if not text:
        return None
    lead: Lead = "none" if text == "none" else "unknown" if text == "unknown" else _whole(text, what)
    if isinstance(lead, int) and lead < 0:
        raise BadInput(f"{what}: the lead is not a track")
    state: State = fit(_STATE, row.get("state") or "accepted", f"{what}, state")
    by = _origin(row, what) if row.get("maker") else origin
    return LeadRange(frame, frame, lead, state, by, row.get("comment") or "", row.get("reviewer") or "")


def _origin(row: dict[str, str], what: str) -> Origin:
    return Origin(
        fit(_MAKER, row["maker"], f"{what}, maker"),
        row.get("by") or "",
        _whole(row.get("made_unix_ms") or "0", what),
        row.get("params") or None,
        row.get("calibration") or None,
        row.get("how") or "",
    )


def _joined(leads: list[LeadRange]) -> list[LeadRange]:
    """Adjacent ranges with the same lead are merged."""
    joined: list[LeadRange] = []
    for each in leads:
        before = joined[-1] if joined else None
        if (
            before is not None
            and before.last + 1 == each.first
            and each == replace(before, first=each.first, last=each.last)
        ):
            joined[-1] = replace(before, last=each.last)
        else:
            joined.append(each)
    return joined


def _whole(text: str | None, what: str) -> int:
    text = (text or "").strip()
    digits = text.removeprefix("-")
    if not (digits.isascii() and digits.isdecimal() and len(text) < _LONGEST_NUMBER):
        raise BadInput(f"{what}: {text[:_LONGEST_NUMBER]!r} is not a number")
    return int(text)
