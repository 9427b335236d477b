"""Scans of further ranging sensors: stored bit for bit, and a damaged one is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.session.range_scan import range_scan_from, range_scan_message
from pipeline.recording.session.source import SessionSource
from pipeline.run import run
from tests.pipeline.recording.frames import full, same, scan, write

SCAN = scan(0, 1000)


def test_a_scan_is_read_as_it_was_written() -> None:
    assert same(range_scan_from("sonar", range_scan_message("sonar", SCAN), SCAN.t_ns), SCAN)
    empty = replace(SCAN, points=np.zeros((0, 3), np.float32), values={})
    assert same(range_scan_from("sonar", range_scan_message("sonar", empty), SCAN.t_ns), empty)


def test_viewers_can_draw_it() -> None:
    message = topics.message_class("/sonar/points").FromString(range_scan_message("sonar", SCAN))
    assert topics.channel("/sonar/points").schema_name == "foxglove.PointCloud"
    assert [field.name for field in message.fields] == ["x", "y", "z", "range_rate_mps"]


@pytest.mark.parametrize(
    "damaged",
    [
        b"\xff",
        range_scan_message("sonar", replace(SCAN, points=np.full((3, 3), np.nan, np.float32))),
        topics.message_class("/sonar/points")(point_stride=12).SerializeToString(),
    ],
)
def test_a_damaged_scan_is_refused(damaged: bytes) -> None:
    with pytest.raises(Damaged, match="/sonar/points"):
        range_scan_from("sonar", damaged, SCAN.t_ns)


def test_a_session_with_a_sensor_that_this_program_does_not_know_opens(tmp_path: Path) -> None:
    session = SessionSource("", str(write(tmp_path / "drive.mcap", [full(0)])))
    assert same(session.frame(0).scans, full(0).scans)
    ((_, result),) = run(session, Params(), Detectors())
    assert {each.source for each in result.objects} <= {"L", "V", "VL"}


def test_without_scans_a_frame_does_not_mention_them(tmp_path: Path) -> None:
    session = SessionSource("", str(write(tmp_path / "drive.mcap", [replace(full(0), scans={})])))
    (message,) = session.file.messages((topics.FRAMES,))
    assert b"scans" not in message.data
    assert not session.frame(0).scans
