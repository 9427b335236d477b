"""A part of a session is a session that gives the same frames, with all that was recorded meanwhile."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import BadInput
from pipeline.params import Params, with_changes
from pipeline.recording.info import info, rhythm
from pipeline.recording.save import save
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import open_source
from pipeline.types import Frame
from tests.pipeline.recording.frames import ABOUT, PERIOD_NS, TRUTH, full, image, same

FRAMES = 12
CHANGED = with_changes(Params(), {"cluster.z_weight": 0.35})


def frame_of(index: int) -> Frame:
    """Every other frame has a new image."""
    return replace(full(index), image=IMAGES[index // 2])


IMAGES = [image(number, t_ns=number) for number in range(FRAMES)]


@pytest.fixture
def drive(tmp_path: Path) -> SessionSource:
    """Parameters change at frame 2; marks after frames 3 and 9."""
    writer = SessionWriter(tmp_path / "drive.mcap", ABOUT)
    for index in range(FRAMES):
        writer.write(frame_of(index), {"frame": str(index)}, Params() if index < 2 else CHANGED, truth=TRUTH)
        if index in (3, 9):
            writer.write_mark(f"after {index}")
    writer.close()
    return SessionSource("a", str(tmp_path / "drive.mcap"))


def test_a_clip_holds_its_frames_and_what_belongs_to_them(drive: SessionSource, tmp_path: Path) -> None:
    save(drive, tmp_path / "clip.mcap", 5, 9)
    clip = SessionSource("b", str(tmp_path / "clip.mcap"))
    assert [same(clip.frame(k), replace(frame_of(5 + k), index=k)) for k in range(len(clip))] == [True] * 5
    assert [clip.result(k) for k in range(5)] == [{"frame": str(5 + k)} for k in range(5)]
    assert [clip.params(k) for k in range(5)] == [CHANGED] * 5
    assert [clip.truth(k) for k in range(5)] == [TRUTH] * 5
    assert [mark.text for mark in clip.marks()] == ["after 9"]
    assert (clip.origin, clip.title) == (drive.origin, drive.title)
    assert clip.file.directory.problem is None


def test_a_clip_begins_where_it_begins(drive: SessionSource, tmp_path: Path) -> None:
    """Although its calibration and its first image are older."""
    save(drive, tmp_path / "clip.mcap", 5, 9)
    assert info(tmp_path / "clip.mcap").duration_s == pytest.approx(0.4, abs=1e-6)


def test_a_clip_of_a_clip(drive: SessionSource, tmp_path: Path) -> None:
    save(drive, tmp_path / "clip.mcap", 3, 9)
    save(SessionSource("b", str(tmp_path / "clip.mcap")), tmp_path / "inner.mcap", 2, 3)
    inner = open_source(str(tmp_path / "inner.mcap"))
    assert [same(inner.frame(k), replace(frame_of(5 + k), index=k)) for k in range(len(inner))] == [True] * 2


def test_a_clip_tells_how_far_it_is_and_can_be_given_up(drive: SessionSource, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    save(drive, tmp_path / "clip.mcap", 5, 9, lambda done, total: told.append((done, total)))
    assert told == [(done, 5) for done in range(1, 6)]

    def give_up(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save(drive, tmp_path / "new.mcap", 5, 9, give_up)
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["clip.mcap", "drive.mcap"]


def test_what_is_there_is_not_written_over_and_what_fails_leaves_nothing(drive: SessionSource, tmp_path: Path) -> None:
    before = drive.file.path.read_bytes()
    with pytest.raises(BadInput, match="already"):
        save(drive, drive.file.path, 0, 1)
    assert drive.file.path.read_bytes() == before

    class Failing:
        uri = title = "failing"
        rate_hz, notes = 10.0, ()

        def __len__(self) -> int:
            return 3

        def frame(self, index: int) -> Frame:
            if index == 2:
                raise KeyboardInterrupt
            return full(index)

        def t_ns(self, index: int) -> int:
            return PERIOD_NS * index

        def truth(self, index: int) -> None:
            return None

    with pytest.raises(KeyboardInterrupt):
        save(Failing(), tmp_path / "new.mcap")
    assert not (tmp_path / "new.mcap").exists()


def test_info_counts_what_is_there(drive: SessionSource) -> None:
    found = info(drive.file.path)
    rhythms = {topic.topic: topic.rhythm for topic in found.topics}
    assert rhythms["/lidar/points"].count == FRAMES
    assert rhythms["/lidar/points"].rate_hz == pytest.approx(10.0)
    assert rhythms["/camera/image"].count == FRAMES / 2
    assert rhythms["/camera/image"].rate_hz == pytest.approx(5.0)
    assert rhythms["/params"].count == 2
    assert {topic.topic: topic.schema for topic in found.topics}["/lidar/points"] == "foxglove.PointCloud"
    assert (found.about, found.marks, found.problem) == (ABOUT, ("after 3", "after 9"), None)
    assert found.duration_s == pytest.approx(1.1)
    assert found.bytes == drive.file.path.stat().st_size


GAPS = {
    "steady": ([0, 1, 2, 3, 4], 1e9, 0, 1e-9),
    "a hole": ([0, 1, 2, 9, 10], 0.4e9, 1, 7e-9),
    "every fifth is missing": ([k for k in range(26) if k % 5 != 4], 20e9 / 25, 5, 2e-9),
    "jitter is no gap": ([0, 10, 22, 30, 41, 50], 0.1e9, 0, 12e-9),
    "a clock that was set back": ([5, 6, 0, 1], 1e9, 0, 1e-9),
    "a drive played in a loop": ([0, 1, 2, 0, 1, 2], 1e9, 0, 1e-9),
    "one": ([7], None, 0, None),
    "none": ([], None, 0, None),
    "all at once": ([3, 3, 3], None, 0, None),
}


@pytest.mark.parametrize(("stamps", "rate_hz", "gaps", "longest_s"), GAPS.values(), ids=GAPS)
def test_rates_and_gaps(stamps: list[int], rate_hz: float | None, gaps: int, longest_s: float | None) -> None:
    found = rhythm(np.array(stamps, dtype=np.int64))
    assert (found.count, found.rate_hz, found.gaps) == (len(stamps), rate_hz, gaps)
    assert found.duration_s == pytest.approx(sum(b - a for a, b in pairwise(stamps) if b > a) / 1e9)
    assert found.longest_gap_s == (None if longest_s is None else pytest.approx(longest_s))
