"""What happened in a session, and the clips around it, cut out of the session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from app.drive.events import find_events
from app.drive.events.event import Event, Severity
from app.drive.events.marks import recorded_marks
from app.drive.recorded_rows import recorded_objects, recorded_row
from pipeline.common.clips import first_frames
from pipeline.common.progress import Progress, silent
from pipeline.params import Params
from pipeline.recording.rewrite import clip
from pipeline.recording.session.source import SessionSource

SEVERITIES: tuple[Severity, ...] = ("info", "notice", "warning", "alarm")
"""The mildest first."""


@dataclass(frozen=True)
class EventClip:
    """Frames of a session, around one or more events."""

    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    events: tuple[Event, ...]
    """Those in it, by frame."""


def recorded_events(session: SessionSource, least: Severity, progress: Progress = silent) -> list[Event]:
    """Marks, and events of this severity or a higher one, by frame, found in the results that were recorded. Frames
    without a result have no events. progress: of frames."""
    rows, objects, places = [], [], []
    for index in range(len(session)):
        progress(index, len(session))
        result = session.result(index)
        try:
            if result is not None:
                row, records = recorded_row(result), recorded_objects(result)
                rows.append(row)
                objects.append(records)
                places.append(index)
        except (KeyError, TypeError, ValueError, AttributeError):
            continue  # a result of another version: what is not understood is no event
    params = session.params(places[0]) if places else None
    found = find_events(rows, objects, params or Params())
    wanted = SEVERITIES[SEVERITIES.index(least) :]
    events = [replace(each, index=places[each.index]) for each in found if each.severity in wanted]
    events += recorded_marks([session.t_ns(index) for index in range(len(session))], session.marks())
    return sorted(events, key=lambda each: (each.index, each.kind, each.ids))


def clips_around(t_ns: Sequence[int], events: Sequence[Event], around_s: float, gap_s: float) -> list[EventClip]:
    """The frames within ``around_s`` before and after each event. Clips that touch are one; none reaches across a gap
    of more than ``gap_s`` in the recording. t_ns: of each frame. events: by frame."""
    begins = [*first_frames(t_ns, gap_s), len(t_ns)]
    clips: list[EventClip] = []
    for event in events:
        part = next(n for n, begin in enumerate(begins) if begin > event.index)
        first = last = event.index
        while first > begins[part - 1] and t_ns[event.index] - t_ns[first - 1] <= around_s * 1e9:
            first -= 1
        while last + 1 < begins[part] and t_ns[last + 1] - t_ns[event.index] <= around_s * 1e9:
            last += 1
        if clips and clips[-1].last + 1 >= first and clips[-1].last >= begins[part - 1]:
            before = clips.pop()
            clips.append(EventClip(before.first, max(before.last, last), (*before.events, event)))
        else:
            clips.append(EventClip(first, last, (event,)))
    return clips


def write_clip(session: SessionSource, wanted: EventClip, out: Path, progress: Progress = silent) -> None:
    """Write a clip as a session of its own. progress: of frames."""
    clip(session, wanted.first, wanted.last, out, progress=progress)
