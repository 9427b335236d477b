"""What happened in a session, read from its recorded results, and the clips around it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.drive.events import find_events
from app.drive.events.event import Event
from app.drive.frame_rows import objects_of, row_of
from app.fleet.sync.event_clips import clips_around, recorded_events, write_clip
from pipeline.params import Params
from pipeline.recording.session.source import SessionSource
from tests.app.fleet.sync.drives import FIRST, MARKED, record


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> SessionSource:
    return SessionSource("a", str(record(tmp_path_factory.mktemp("car") / "a.mcap")[0]))


def test_the_events_are_those_of_the_run_that_was_recorded(tmp_path: Path):
    """All except disagreements of camera and LiDAR, which results do not contain."""
    file, ran = record(tmp_path / "b.mcap")
    rows, objects = [row_of(frame, result) for frame, result in ran], [objects_of(result) for _, result in ran]
    expected = [each for each in find_events(rows, objects, Params()) if each.kind != "vl_disagreement"]
    found = recorded_events(SessionSource("b", str(file)), "info")
    assert [each for each in found if each.kind != "mark"] == expected
    assert {"cut_in", "brake"} <= {each.kind for each in found}
    assert [each.index for each in found if each.kind == "mark"] == [MARKED - FIRST]


def test_marks_always_count_and_other_events_by_severity(session: SessionSource):
    assert {each.severity for each in recorded_events(session, "info")} >= {"info", "warning"}
    grave = recorded_events(session, "warning")
    assert {each.kind for each in grave if each.severity not in ("warning", "alarm")} == {"mark"}


def event(index: int) -> Event:
    return Event("mark", index, "")


def spans(t_s: list[float], *at: int, around_s: float = 0.25) -> list[tuple[int, int, int]]:
    t_ns = [round(each * 1e9) for each in t_s]
    found = clips_around(t_ns, [event(index) for index in at], around_s, 0.5)
    return [(each.first, each.last, len(each.events)) for each in found]


def test_a_clip_is_what_lies_around_an_event():
    times = [n / 10 for n in range(20)]
    assert spans(times, 10) == [(8, 12, 1)]
    assert spans(times, 0, 19) == [(0, 2, 1), (17, 19, 1)]


def test_clips_that_touch_are_one():
    times = [n / 10 for n in range(20)]
    assert spans(times, 5, 7) == [(3, 9, 2)]
    assert spans(times, 5, 10) == [(3, 12, 2)]
    assert spans(times, 5, 11) == [(3, 7, 1), (9, 13, 1)]


def test_no_clip_reaches_across_a_gap():
    times = [*(n / 10 for n in range(10)), *(60 + n / 10 for n in range(10))]
    assert spans(times, 9, 10) == [(7, 9, 1), (10, 12, 1)]


def test_a_clip_holds_its_frames_with_their_results(session: SessionSource, tmp_path: Path):
    (wanted,) = clips_around([session.t_ns(n) for n in range(len(session))], [event(10)], 0.25, 0.5)
    write_clip(session, wanted, tmp_path / "clip.mcap")
    clip = SessionSource("clip", str(tmp_path / "clip.mcap"))
    assert len(clip) == wanted.last + 1 - wanted.first == 5
    for place, index in enumerate(range(wanted.first, wanted.last + 1)):
        assert clip.result(place) == session.result(index)
        ours, theirs = clip.sweep(place), session.sweep(index)
        assert ours is not None
        assert theirs is not None
        np.testing.assert_array_equal(ours.points, theirs.points)
