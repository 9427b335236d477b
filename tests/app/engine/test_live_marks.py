"""Marks of live sensors: on their timeline, in the session that is recorded, and on every recording of their time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.drive.events.event import Event
from app.drive.events.marks import marks_by_time
from app.drive.marks import Marks, SavedMark
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.web.server import create_app
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types.source import AnySource
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.app.engine.test_live_engine import Sensors, shows
from tests.app.web.serving import serving

WAIT_S = 180.0


class Car:
    """A server on live sensors that can open a recording of the same time."""

    def __init__(self, sessions: Path, marks: Path | None) -> None:
        self.sensors, self.recording = Sensors(), Recording()

        def open_either(uri: str, **_: Any) -> AnySource:
            if uri == self.sensors.uri:
                return self.sensors
            return self.recording if uri == self.recording.uri else open_source(uri)

        self.engine = Engine(
            open_either,
            lambda _: CountingDetector(),
            Params(),
            uri=self.sensors.uri,
            playing=True,
            whole_drives=True,
            recorder=SessionRecorder(sessions),
        )
        self.app = create_app(self.engine, marks=Marks(marks))

    def give(self, index: int) -> None:
        self.sensors.give(index)
        self.engine.wait_for(shows(index), WAIT_S)

    def open(self, uri: str) -> None:
        self.engine.control.change(uri=uri)
        self.engine.wait_for(lambda s: s.uri == uri and s.drive.done == s.count > 0, WAIT_S)


@pytest.fixture
def car(tmp_path: Path) -> Iterator[Car]:
    car = Car(tmp_path / "sessions", tmp_path / "marks")
    car.engine.start()
    car.engine.wait_for(lambda s: s.live, WAIT_S)
    yield car
    car.engine.stop()


@pytest.fixture
def client(car: Car) -> Iterator[httpx.Client]:
    with serving(car.app) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def marked(client: httpx.Client) -> list[tuple[float, str]]:
    events = client.get("/api/drive/events").json()["events"]
    return [(round(event["t_s"], 3), event["text"]) for event in events if event["kind"] == "mark"]


def test_a_mark_is_on_the_live_timeline_and_on_a_recording_of_its_time(car: Car, client: httpx.Client):
    assert client.post("/api/marks", json={}).status_code == 409, "nothing is shown yet"
    for index in (3, 4, 8):
        car.give(index)
    revision = car.engine.snapshot.drive.revision
    made = client.post("/api/marks", json={"index": 2, "text": "he braked"}).json()
    assert (made["t_s"], made["in_session"]) == (pytest.approx(0.5), False), "where it is now, whatever the page showed"
    car.engine.wait_for(lambda s: s.drive.revision > revision, WAIT_S)
    car.give(9)
    assert marked(client) == [(0.5, "he braked")]
    car.open(car.recording.uri)
    assert marked(client) == [(0.8, "he braked")], "the recording has that very moment in frame 8"
    assert client.delete(f"/api/marks/{made['id']}").status_code == 404, "it is not the recording's own"
    car.engine.control.change(uri=car.sensors.uri)
    car.engine.wait_for(lambda s: s.live, WAIT_S)
    car.give(20)
    assert marked(client) == [], "it was before these sensors were opened"
    later = client.post("/api/marks", json={}).json()
    assert marked(client) == [(0.0, "marked")]
    assert client.delete(f"/api/marks/{later['id']}").status_code == 200
    assert marked(client) == []


def test_a_mark_that_a_session_has_is_there_once(car: Car, client: httpx.Client):
    car.give(0)
    client.post("/api/recording", json={"on": True})
    car.give(1)
    car.give(2)
    assert client.post("/api/marks", json={}).json()["in_session"]
    assert marked(client) == [(0.2, "marked")]
    car.give(3)
    file = client.post("/api/recording", json={"on": False}).json()["file"]
    car.open(file)
    assert [text for _, text in marked(client)] == ["marked"]


def test_the_alignment_of_live_sensors_is_scored_from_what_they_show(car: Car, client: httpx.Client):
    assert client.get("/api/alignment/score").status_code == 404
    for index, frames in ((0, 1), (1, 1), (6, 2)):
        car.give(index)
        found = client.get("/api/alignment/score").json()
        assert f"in {frames} frame" in found["text"], "half a second apart, or they show the same"
        assert found["borders"] > 0


@pytest.mark.parametrize(
    ("name", "mark", "frames"),
    [
        ("at a frame's very time", SavedMark(1, 99, "", 2000), [2]),
        ("near a frame", SavedMark(1, 99, "", 1960), [2]),
        ("before the recording", SavedMark(1, 99, "", 500), []),
        ("after it", SavedMark(1, 99, "", 9000), []),
        ("without a time", SavedMark(1, 1), []),
        ("in a session, which has it itself", SavedMark(1, 99, "", 2000, in_session=True), []),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_marks_by_time(name: str, mark: SavedMark, frames: list[int]):
    stamps = np.array([800, 1000, 2000, 3000], np.int64)
    assert marks_by_time([mark], stamps, 100) == [Event("mark", frame, "marked") for frame in frames]
    assert marks_by_time([mark], stamps[:0], 100) == []
