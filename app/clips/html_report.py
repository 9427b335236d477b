"""Exports a clip as one HTML file: events, curves, images of the key moments, and the parameters and networks used."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import cv2

from app.clips.clip import Clip, clip_frames, one_frame
from app.clips.overlay import draw_frame
from app.drive.events import find_events
from app.drive.events.event import Event
from app.drive.frame_rows import Objects, Row, objects_of, row_of
from app.reports.html import page, section_html
from pipeline.common.progress import Progress
from pipeline.evaluation.report_sections import Chart, ReportSection, Series, Table
from pipeline.params import Params, to_yaml
from pipeline.types import F64, U8, Frame, Result

MOST_IMAGES = 6
_JPEG_QUALITY = 82
_CURVES = (
    ("Distance to the CIPV", "m", ("distance_m",)),
    ("Closing speed", "m/s", ("closing_speed_mps",)),
    ("Time to collision", "s", ("ttc_s",)),
    ("Path offset of the CIPV", "m", ("path_offset_m",)),
    ("Ego and desired speed", "m/s", ("speed_mps", "desired_speed_mps")),
    ("Brake", "fraction of the pedal", ("brake",)),
)
_LONGEST_TTC_S = 20.0
_WEIGHT = {"alarm": 0, "warning": 1, "notice": 2, "info": 3}


@dataclass(frozen=True)
class ClipInfo:
    """The origin of a clip."""

    title: str
    """Title of the recording."""
    uri: str
    """URI with which the recording was opened."""
    first: int
    """First frame of the clip."""
    last: int
    """Last frame of the clip, included."""
    timeline_s: F64
    """(N,) position of each frame of the whole drive on the playback timeline, in seconds."""
    digest: str
    """Short digest of the run's inputs: recording, parameters, networks."""


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write the clip as one HTML file."""
    recording, params = clip.recording, clip.params
    setup = recording.setup
    info = ClipInfo(clip.title, setup.uri, clip.first, clip.last, setup.timeline_s, recording.digest(params))
    run = clip_frames(clip, progress, images=False)
    text = clip_page(run, lambda index: draw_frame(*one_frame(recording, params, index), params), params, info)
    path.write_text(text, encoding="utf-8")


def clip_page(run: Iterable[tuple[Frame, Result]], draw: Callable[[int], U8], params: Params, info: ClipInfo) -> str:
    """The whole file, which loads nothing else. ``draw`` returns the BGR image of a frame of the drive with the
    overlay; it is called for the first frame and for those of the most important events."""
    rows: list[Row] = []
    objects: list[Objects] = []
    names: list[str] = []
    for frame, result in run:
        rows.append(row_of(frame, result))
        objects.append(objects_of(result))
        names.append(frame.name)
    events = find_events(rows, objects, params)
    times = info.timeline_s[info.first : info.first + len(rows)].tolist()
    sections = [
        _summary(rows, names, info),
        _events(events, names, times),
        ReportSection("curves", "Curves", charts=tuple(_charts(rows, times))),
    ]
    said = worth_an_image(events)
    images = {place: (_jpeg(draw(info.first + place)), text) for place, text in said.items()}
    body = "".join(map(section_html, sections)) + _images(images, names) + _made_with(params)
    return page(f"{info.title}: frames {names[0]} to {names[-1]}", body)


def worth_an_image(events: Sequence[Event]) -> dict[int, str]:
    """Index in the clip → caption of the images to show, in order: the first frame and the most important events."""
    weighty = sorted(events, key=lambda event: (_WEIGHT[event.severity], event.index))
    said: dict[int, str] = {}
    for event in weighty:
        if len(said) < MOST_IMAGES - 1:
            said.setdefault(event.index, event.text)
    return dict(sorted({0: "start of the clip", **said}.items()))


def _jpeg(drawn: U8) -> bytes:
    return cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _summary(rows: Sequence[Row], names: Sequence[str], info: ClipInfo) -> ReportSection:
    with_lead = sum(row.cipv_id is not None for row in rows)
    leads = {row.cipv_id for row in rows} - {None}
    text = (
        f"Frames {names[0]} to {names[-1]} ({len(rows)}) of {info.uri}.",
        f"{with_lead} frames with a CIPV, {len(leads)} different vehicle{'s' if len(leads) != 1 else ''}. "
        f"Runs with the same input and parameters have the digest {info.digest}.",
    )
    return ReportSection("clip", "Clip", text)


def _events(events: Sequence[Event], names: Sequence[str], times: Sequence[float]) -> ReportSection:
    rows = tuple((names[each.index], round(times[each.index], 2), each.kind, each.text) for each in events)
    table = Table("What happened", ("frame", "at s", "kind", "event"), rows)
    return ReportSection("events", "Events", tables=(table,) if rows else (), text=() if rows else ("No events.",))


def _charts(rows: Sequence[Row], times: Sequence[float]) -> Iterable[Chart]:
    for title, unit, names in _CURVES:
        lines = []
        for name in names:
            known = [(t, getattr(row, name)) for t, row in zip(times, rows, strict=True)]
            points = [(t, value) for t, value in known if value is not None and _is_drawn(name, value)]
            lines.append(Series(name, tuple(t for t, _ in points), tuple(value for _, value in points)))
        if any(line.x for line in lines):
            yield Chart(title, "s", unit, tuple(lines))


def _is_drawn(name: str, value: float) -> bool:
    return name != "ttc_s" or value <= _LONGEST_TTC_S


def _images(images: dict[int, tuple[bytes, str]], names: Sequence[str]) -> str:
    figures = "".join(
        f"<figure><figcaption>{escape(names[place])}: {escape(text)}</figcaption>"
        f'<img style="width:100%" alt="Camera at frame {escape(names[place])} with the result drawn over it" '
        f'src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"></figure>'
        for place, (jpeg, text) in images.items()
    )
    return f'<section id="images"><h2>Images</h2>{figures}</section>'


def _made_with(params: Params) -> str:
    text = "These parameters, as a file for <code>cipv run --params</code>."
    return (
        f'<section id="parameters"><h2>Parameters</h2><p>{text}</p>'
        f"<details><summary>Show</summary><pre>{escape(to_yaml(params))}</pre></details></section>"
    )
