"""A drive is read ahead by one frame, watched to its end, and ended at any step."""

from __future__ import annotations

import threading

import pytest

from pipeline.calibration.alignment.drive import FRAMES, fit_drive
from pipeline.calibration.alignment.fit import STEPS, NothingToFit
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import Frame

SCENE = """
title: traffic for a fit
seed: 4
duration_s: 6
rate_hz: 5
road: {segments: [{length_m: 1000}], lanes_forward: 3}
ego: {lane: -2, speed_mps: {0: 12}}
detections: {boxes: {}}
actors:
  - {id: 1, kind: car, lane: -2, ahead_m: 18, speed_mps: {0: 10}}
  - {id: 2, kind: car, lane: -1, ahead_m: 12, speed_mps: {0: 14}}
  - {id: 3, kind: car, lane: -3, ahead_m: 14, speed_mps: {0: 13}}
  - {id: 4, kind: car, lane: -1, ahead_m: 30, speed_mps: {0: 11}}
"""


class Ended(Exception):
    pass


def test_every_step_is_told_once_and_in_order(tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    source = open_source(f"sim:{tmp_path / 'scene.yaml'}")
    told: list[tuple[int, int]] = []
    fit = fit_drive(source.frame, len(source), "pinhole", Params(), progress=lambda *step: told.append(step))
    total = len(source) + STEPS
    assert fit.values["yaw_deg"] == pytest.approx(0.0, abs=0.3)
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert {each for _, each in told} == {total}
    assert told[-1] == (total, total)
    assert set(range(len(source))) <= {done for done, _ in told}


def test_frames_are_read_one_ahead_and_no_more_after_the_end():
    read: list[int] = []
    readers: set[int] = set()

    def frame_of(index: int) -> Frame:
        read.append(index)
        readers.add(threading.get_ident())
        return Frame(index, str(index), index * 100_000_000)

    def ended(done: int, total: int) -> None:
        assert len(read) <= done + 2
        if done == 4:
            raise Ended

    with pytest.raises(Ended):
        fit_drive(frame_of, 10 * FRAMES, "pinhole", Params(), progress=ended)
    assert len(read) <= 6
    assert readers
    assert threading.get_ident() not in readers


def test_a_drive_without_frames_has_nothing_to_fit():
    with pytest.raises(NothingToFit):
        fit_drive(lambda index: pytest.fail("there is none"), 0, "pinhole", Params())
