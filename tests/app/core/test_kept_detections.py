"""Detections are cached by the detector's input, and a failing disk only costs time."""

from __future__ import annotations

import sqlite3
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.core.detection_cache import DetectionCache
from app.core.kept_detections import KeptDetections, seen_mark
from app.engine.engine import Engine
from pipeline.params import Params
from pipeline.types import CameraImage, DistanceLaw, EgoState, Frame, RawBoxes, RawLanes
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.waiting import WAIT_S, wait_until

LAW = DistanceLaw(1000.0, -1.1, 900.0, 1.5, 2.0, 0.7)
BOXES = RawBoxes(
    "made", np.array([[1, 2, 30, 40]], np.float32), np.array([0.1], np.float32), ("car",), LAW, (0, 0, 9, 9), 1
)
LANES = RawLanes("lines", np.array([[1.5, 2.5]], np.float32), np.ones(1, np.float32), np.array([-1], np.int32))


class Counting:
    """A detector that counts how often it runs."""

    def __init__(self, name: str = "made", answer: RawBoxes | RawLanes = BOXES) -> None:
        self.name, self.notes, self.runs, self._answer = name, (), 0, answer

    def detect(self, bgr: np.ndarray) -> RawBoxes | RawLanes:
        self.runs += 1
        return self._answer


def frame(shade: int = 0, **fields: object) -> Frame:
    made = Frame(0, "0", 0, image=CameraImage(0, np.full((4, 5, 3), shade, np.uint8)))
    return replace(made, **fields)  # type: ignore[arg-type]


def ask(file: Path, detector: Counting, seen: Frame) -> RawBoxes | RawLanes:
    """Ask with an empty memory, like a program that was just started."""
    kept = KeptDetections(file)
    assert seen.image is not None
    find: Any = DetectionCache(kept=kept).look_at("test:made")
    found: RawBoxes | RawLanes = find(detector, seen, seen.image.bgr)
    kept.close()
    return found


@pytest.mark.parametrize("answer", [BOXES, LANES], ids=["boxes", "lanes"])
def test_a_new_start_runs_no_network_and_gets_the_same(tmp_path: Path, answer: RawBoxes | RawLanes) -> None:
    detector = Counting(answer=answer)
    ask(tmp_path / "kept.db", detector, frame())
    again = ask(tmp_path / "kept.db", detector, frame())
    assert detector.runs == 1
    for name, value in vars(answer).items():
        np.testing.assert_array_equal(getattr(again, name), value)


def test_an_engine_that_ends_writes_what_waits_and_closes_the_file(tmp_path: Path) -> None:
    """Its log of changes is merged, so that the file can be copied alone."""
    detections = DetectionCache(kept=KeptDetections(tmp_path / "kept.db"))
    engine = Engine(opener(Recording()), lambda _: CountingDetector(), Params(), uri="test:car", detections=detections)
    engine.start()
    engine.wait_for(lambda shown: shown.processed is not None, WAIT_S)
    engine.stop()
    assert [file.name for file in tmp_path.iterdir()] == ["kept.db"]
    with sqlite3.connect(tmp_path / "kept.db") as database:
        assert database.execute("SELECT count(*) FROM detections").fetchone() == (1,)
    database.close()


def test_what_else_is_asked_runs_the_network(tmp_path: Path) -> None:
    file = tmp_path / "kept.db"
    ask(file, Counting(), frame())
    turning = frame(ego=EgoState(0, 10.0, 0.1))  # the far view follows the bend
    for detector, seen in ((Counting("other"), frame()), (Counting(), frame(1)), (Counting(), turning)):
        ask(file, detector, seen)
        assert detector.runs == 1


def test_a_file_that_is_no_database_only_costs_time(tmp_path: Path) -> None:
    (tmp_path / "kept.db").write_bytes(b"no database at all" * 100)
    detector = Counting()
    assert ask(tmp_path / "kept.db", detector, frame()) is BOXES
    assert detector.runs == 1


def test_a_damaged_answer_only_costs_time(tmp_path: Path) -> None:
    detector = Counting()
    ask(tmp_path / "kept.db", detector, frame())
    with sqlite3.connect(tmp_path / "kept.db") as database:
        database.execute("UPDATE detections SET answer = ?", (b"damaged",))
    database.close()
    ask(tmp_path / "kept.db", detector, frame())
    assert detector.runs == 2


def test_the_oldest_are_dropped(tmp_path: Path) -> None:
    kept = KeptDetections(tmp_path / "kept.db", most_bytes=1)
    marks = [seen_mark(frame(shade)) for shade in range(10)]
    for mark in marks:
        assert mark is not None
        kept.put(mark, "made", BOXES)
    kept.drop_oldest()
    assert kept.get(marks[0] or b"", "made") is None
    kept.close()


def test_without_an_image_there_is_nothing_to_keep() -> None:
    assert seen_mark(Frame(0, "0", 0)) is None


def test_a_disk_that_hangs_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate, execute = threading.Event(), KeptDetections._execute

    def when_it_responds(self: KeptDetections, *arguments: Any) -> list[tuple[Any, ...]]:
        assert gate.wait(60.0)
        return execute(self, *arguments)

    monkeypatch.setattr(KeptDetections, "_execute", when_it_responds)
    kept = KeptDetections(tmp_path / "kept.db")
    marks = [seen_mark(frame(shade)) or b"" for shade in range(200)]
    for mark in marks * 3:  # more than may wait
        kept.put(mark, "made", BOXES)
    assert kept.get(marks[0], "made") is None
    monkeypatch.setattr("app.core.kept_detections._ANSWER_S", 60.0)
    assert kept.get(marks[0], "made") is None, "while one answer is late, none is waited for"
    gate.set()
    assert wait_until(lambda: kept.get(marks[0], "made") is not None), "it is used again once it responds"
    kept.close()
