"""The kinds of file that a part of a drive can be taken away as: each is one function that writes it, and imports what
that takes (films, MCAP, pages: 0.4 s together) when one is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.clips.frames import clip_frames, one_frame
from app.clips.jobs import Job, Jobs, Report
from app.drive.compute_scheduler import Turn
from app.drive.open_recording import Recording
from app.views.rerun_start_options import Opening
from pipeline.common.errors import BadInput
from pipeline.params import Params
from pipeline.types import F32
from pipeline.types.result_json import to_json

Kind = Literal["mcap", "rrd", "mp4", "csv", "html", "ply"]
MOST_FRAMES = 6000


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames ``first`` to ``last`` of a recording, both included, run with these parameters. turn: to be asked before
    each frame is computed. opening: of a replay, in rerun."""

    recording: Recording
    params: Params
    first: int
    last: int
    turn: Turn
    title: str
    rate_hz: float
    opening: Opening = Opening()


def submit(jobs: Jobs, clip: Clip, kind: Kind) -> Job:
    """Begin to write a clip. BadInput when it is none, or too long."""
    total = clip.recording.recipe.total
    if not 0 <= clip.first <= clip.last < total:
        raise BadInput(f"a clip goes from a frame to a later one of 0 to {total - 1}")
    if clip.last + 1 - clip.first > MOST_FRAMES:
        raise BadInput(f"a clip holds {MOST_FRAMES} frames at most")
    name = f"clip-{clip.first:06d}-{clip.last:06d}.{kind}"
    return jobs.submit(kind, clip.first, clip.last, name, lambda path, report: WRITERS[kind](clip, path, report))


def _mcap(clip: Clip, path: Path, report: Report) -> None:
    clip.recording.save(path, clip.first, clip.last, report)


def _rrd(clip: Clip, path: Path, report: Report) -> None:
    from app.clips.excerpt import write_rrd

    run = clip_frames(clip.recording, clip.params, clip.first, clip.last, report, clip.turn)
    write_rrd(clip.title, run, path, clip.params, clip.opening)


def _mp4(clip: Clip, path: Path, report: Report) -> None:
    from app.clips.video import write_film

    run = clip_frames(clip.recording, clip.params, clip.first, clip.last, report, clip.turn)
    write_film(run, clip.params, clip.recording.recipe.timeline_s, clip.rate_hz, path)


def _csv(clip: Clip, path: Path, report: Report) -> None:
    from app.clips.excerpt import write_csv

    run = clip_frames(clip.recording, clip.params, clip.first, clip.last, report, clip.turn, pictures=False)
    write_csv((to_json(result) for _, result in run), path)


def _html(clip: Clip, path: Path, report: Report) -> None:
    from app.clips.html_report import About, clip_page
    from app.clips.overlay import draw_frame

    recording, params = clip.recording, clip.params
    recipe = recording.recipe
    about = About(clip.title, recipe.uri, clip.first, clip.last, recipe.timeline_s, recording.digest(params))
    run = clip_frames(recording, params, clip.first, clip.last, report, clip.turn, pictures=False)
    text = clip_page(run, lambda index: draw_frame(*one_frame(recording, params, index), params), params, about)
    path.write_text(text, encoding="utf-8")


def _ply(clip: Clip, path: Path, report: Report) -> None:
    from app.clips.point_cloud import MOST_SWEEPS, write_ply

    total = clip.last + 1 - clip.first
    if total > MOST_SWEEPS:
        raise BadInput(f"a point cloud takes {MOST_SWEEPS} frames at most")
    report(0, total)

    def sweeps() -> Iterator[F32 | None]:
        for index in range(clip.first, clip.last + 1):
            with clip.turn.background(to_the_end=True):
                sweep = clip.recording.as_read(index).sweep
            yield sweep.points if sweep is not None else None
            report(index + 1 - clip.first, total)

    write_ply(sweeps(), path)


WRITERS: dict[Kind, Callable[[Clip, Path, Report], None]] = {
    "mcap": _mcap,
    "rrd": _rrd,
    "mp4": _mp4,
    "csv": _csv,
    "html": _html,
    "ply": _ply,
}
