"""Recording from the page: started, stopped and marked over the API, fed by the running engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.core.detection_cache import DetectionCache
from app.engine.engine import Engine
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.session_recording import SessionRecorder, new_session
from app.web.server import create_app
from app.web.source_catalog import sessions
from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.recording.segments import Segments
from pipeline.recording.session.source import Mark, SessionSource
from pipeline.run import run
from pipeline.types.result_json import to_json
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.waiting import Runs, loop_apart
from tests.pipeline.recording.frames import same

WAIT_S = 180.0


@pytest.fixture
def engine(tmp_path: Path) -> Iterator[Engine]:
    first, second = Recording(), Recording("test:other", count=5)
    desk = SessionRecorder(tmp_path / "sessions")
    engine = Engine(opener(first, second), lambda _: CountingDetector(), Params(), uri=first.uri, recorder=desk)
    engine.start()
    engine.wait_for(lambda shown: shown.processed is not None, WAIT_S)
    yield engine
    engine.stop()


class Client:
    """Calls the application directly, without a network."""

    def __init__(self, engine: Engine, run: Runs) -> None:
        self._app, self._run = create_app(engine), run

    def get(self, path: str) -> httpx.Response:
        return self._ask("GET", path)

    def post(self, path: str, json: dict[str, Any]) -> httpx.Response:
        return self._ask("POST", path, json)

    def _ask(self, method: str, path: str, json: dict[str, Any] | None = None) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self._app)
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
                return await client.request(method, path, json=json)

        return self._run(ask())


@pytest.fixture
def client(engine: Engine) -> Iterator[Client]:
    with loop_apart() as run:
        yield Client(engine, run)


def show(engine: Engine, index: int) -> dict[str, Any]:
    """Seek, wait, and return the frame's final result."""
    engine.control.seek(index)
    shown = engine.wait_for(
        lambda shown: shown.processed is not None and shown.index == index and shown.processed.whole, WAIT_S
    )
    assert shown.processed is not None
    return to_json(shown.processed.result)


def without_timing(result: dict[str, Any] | None) -> dict[str, Any]:
    assert result is not None
    return {name: value for name, value in result.items() if name != "timing_ms"}


def test_what_is_shown_between_start_and_stop_is_in_the_session(client: Client, engine: Engine) -> None:
    assert client.get("/api/recording").json() is None
    started = client.post("/api/recording", json={"on": True}).json()
    assert (started["frames"], started["dropped"], started["error"]) == (0, 0, None)
    results = [show(engine, index) for index in (3, 7, 4)]
    engine.control.change_params({"cluster.z_weight": 0.35})
    engine.wait_for(lambda shown: shown.params.cluster.z_weight == 0.35, WAIT_S)
    assert client.post("/api/marks", json={"text": "he braked"}).status_code == 201
    results.append(show(engine, 9))
    stopped = client.post("/api/recording", json={"on": False}).json()
    assert stopped["file"] == started["file"]
    assert stopped["frames"] == 4
    session = SessionSource("a", stopped["file"])
    assert [session.frame(k).name for k in range(len(session))] == ["000003", "000007", "000004", "000009"]
    assert [session.result(k) for k in range(4)] == results
    ran = [to_json(result) for _, result in run(Recording(), Params(), Detectors(CountingDetector()))]
    assert [without_timing(session.result(k)) for k in range(3)] == [without_timing(ran[k]) for k in (3, 7, 4)]
    assert [mark.text for mark in session.marks()] == ["he braked"]
    assert [session.params(k).cluster.z_weight for k in range(4)][2:] == [Params().cluster.z_weight, 0.35]  # type: ignore[union-attr]
    assert same(session.frame(0).sweep, Recording().frame(3).sweep)
    assert session.origin == "test:car"
    show(engine, 2)
    assert client.get("/api/recording").json() is None
    assert len(SessionSource("a", stopped["file"])) == 4


def test_a_frame_waits_for_its_exact_result_and_its_marks_with_it(tmp_path: Path) -> None:
    desk, source = SessionRecorder(tmp_path), Recording()
    pipeline = SeekablePipeline(source, Detectors(CountingDetector()), DetectionCache(), "both")
    exact = pipeline.seek(8, Params())
    assert exact is not None
    guess = replace(exact, result=replace(exact.result, notes=("a guess",)), exact=False)
    last = pipeline.seek(20, Params())
    assert last is not None
    assert not last.exact
    desk.start(source)
    desk.take(guess)
    assert desk.mark("at eight")
    other = with_changes(Params(), {"cipv.confirm_hits": 5})
    desk.take(replace(exact, params=other, result=replace(exact.result, notes=("of other parameters",))))
    desk.take(exact)
    desk.take(guess)
    desk.take(last)
    assert desk.mark("at twenty")
    state = desk.stop()
    assert state is not None
    session = SessionSource("a", str(state.file))
    assert [session.result(k) for k in range(len(session))] == [to_json(exact.result), to_json(last.result)]
    assert [session.params(k) for k in range(2)] == [Params()] * 2
    assert session.marks() == (Mark(exact.frame.t_ns, "at eight"), Mark(last.frame.t_ns, "at twenty"))


def test_the_state_tells_how_it_goes(client: Client, engine: Engine) -> None:
    assert client.get("/api/state").json()["recording"] is None
    file = client.post("/api/recording", json={"on": True}).json()["file"]
    assert client.post("/api/recording", json={"on": True}).json()["file"] == file, "it just goes on"
    show(engine, 3)
    engine.wait_for(lambda shown: shown.recording is not None, WAIT_S)
    state = client.get("/api/state").json()["recording"]
    assert state.keys() == {"file", "frames", "seconds", "bytes", "dropped", "error", "dropped_because", "trouble"}
    client.post("/api/recording", json={"on": False})
    engine.wait_for(lambda shown: shown.recording is None, WAIT_S)


def test_a_recording_of_nothing_leaves_no_file(client: Client) -> None:
    file = client.post("/api/recording", json={"on": True}).json()["file"]
    assert Path(file).exists()
    assert client.post("/api/recording", json={"on": False}).json() is None
    assert not Path(file).exists()


def test_opening_something_else_ends_it(client: Client, engine: Engine) -> None:
    file = client.post("/api/recording", json={"on": True}).json()["file"]
    show(engine, 3)
    client.post("/api/source", json={"uri": "test:other"})
    engine.wait_for(lambda shown: shown.uri == "test:other" and shown.processed is not None, WAIT_S)
    assert client.get("/api/recording").json() is None
    assert SessionSource("a", file).notes == ("made for a test",), "the file is whole"


def test_what_goes_wrong_is_one_sentence(
    client: Client, engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sessions").write_text("in the way")
    answer = client.post("/api/recording", json={"on": True})
    assert answer.status_code == 409
    assert "cannot record here" in answer.json()["detail"]
    (tmp_path / "sessions").unlink()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Segments, "write", fail)
    client.post("/api/recording", json={"on": True})
    show(engine, 3)
    for index in range(4, 30):  # until the recorder's thread has come to it
        show(engine, index)
        state = engine.snapshot.recording
        if state is not None and state.error is not None:
            break
    assert "No space left on device" in client.get("/api/recording").json()["error"]
    assert not engine.recorder.mark("lost")
    show(engine, 2), "the pipeline goes on"


def test_nothing_open_is_nothing_to_record(tmp_path: Path) -> None:
    engine = Engine(opener(), None, Params(), recorder=SessionRecorder(tmp_path))
    with loop_apart() as run:
        assert Client(engine, run).post("/api/recording", json={"on": True}).status_code == 409
    assert not list(tmp_path.iterdir())


def test_sessions_are_offered_the_newest_first(tmp_path: Path) -> None:
    for age, name in enumerate(("new", "old")):
        (tmp_path / f"{name}.mcap").touch()
        os.utime(tmp_path / f"{name}.mcap", (1e9 - age, 1e9 - age))
    expected = [(str(tmp_path / f"{name}.mcap"), f"session · {name}") for name in ("new", "old")]
    assert sessions(tmp_path) == expected
    assert sessions(tmp_path / "nowhere") == []


def test_files_are_named_by_title_and_never_twice(tmp_path: Path) -> None:
    assert new_session(tmp_path / "mine.mcap", "any title") == tmp_path / "mine.mcap"
    first = new_session(tmp_path / "deep" / "folder", "Zürich → Bern/2026: ../x")
    assert first.parent == tmp_path / "deep" / "folder"
    assert first.name.startswith("z-rich-bern-2026-x_")
    first.touch()
    assert new_session(first.parent, "Zürich → Bern/2026: ../x") != first
