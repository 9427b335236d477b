"""A kind of event, a timeline column, an export, a command and an API route: one new module and one registration. A
parameter: one field."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import httpx
import pytest
from fastapi import APIRouter

from app import cli
from app.clips.clip import Clip
from app.clips.export_queue import ExportQueue
from app.clips.exports import EXPORTERS, submit, write_clip
from app.commands.support.options import PipelineOptions
from app.drive.events import FINDERS, event_kinds, find_events
from app.drive.events.event import Event, EventFinder, RunRows
from app.drive.frame_rows import column_names, columns_json, row_of
from app.drive.timeline_columns import EXTRA_COLUMNS
from app.web.routers import ROUTERS, Services
from app.web.routes.params import describe
from app.web.server import create_app
from pipeline.common.progress import silent
from pipeline.detection import Detectors
from pipeline.params import CipvParams, Params, ParamsError, flat, from_yaml, to_yaml, with_changes
from pipeline.params.declare import slider
from pipeline.run import run
from tests.app.drive.rows import drive, objects
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.app.web.serving import WAIT_S, running, serving
from tests.docs.reference_pages import parameters_page


@pytest.fixture
def new_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The name of a module that is written by the test, as ``write_module`` does."""
    monkeypatch.syspath_prepend(str(tmp_path))
    yield "added_by_a_test"
    sys.modules.pop("added_by_a_test", None)


def write_module(folder: Path, name: str, text: str) -> None:
    (folder / f"{name}.py").write_text(dedent(text), encoding="utf-8")


def test_a_kind_of_event(monkeypatch: pytest.MonkeyPatch) -> None:
    def halves(run: RunRows) -> Iterator[Event]:
        yield Event("half_time", len(run.rows) // 2, "half of the drive is over")

    monkeypatch.setattr("app.drive.events.FINDERS", [*FINDERS, EventFinder(("half_time",), halves)])
    assert "half_time" in event_kinds()
    found = find_events(drive(None, None), [objects()] * 2, Params())
    assert [(event.kind, event.index) for event in found] == [("half_time", 1)]


def test_a_timeline_column(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EXTRA_COLUMNS, "points", lambda frame, result: len(frame.sweep.points) if frame.sweep else None)
    source = Recording(count=2)
    rows = [row_of(frame, result) for frame, result in run(source, Params(), Detectors())]
    assert column_names()[-1] == "points"
    sweeps = [source.frame(index).sweep for index in range(2)]
    assert columns_json(rows)["points"] == [len(sweep.points) for sweep in sweeps if sweep is not None]


def test_an_export(new_module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_module(
        tmp_path,
        new_module,
        """
        from app.clips.clip import clip_frames

        def write(clip, path, progress):
            path.write_text(" ".join(frame.name for frame, _ in clip_frames(clip, progress)))
        """,
    )
    monkeypatch.setitem(EXPORTERS, "txt", new_module)
    source = Recording(count=5)
    clip = Clip.of_source(source, Params(), 2, 3, Detectors(CountingDetector()))
    write_clip(clip, "txt", tmp_path / "clip.txt", silent)
    assert (tmp_path / "clip.txt").read_text() == "000002 000003"
    queue = ExportQueue()
    assert submit(queue, clip, "txt").kind == "txt"
    queue.close()


def test_a_command(
    new_module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_module(
        tmp_path,
        new_module,
        '''
        from dataclasses import dataclass

        @dataclass(frozen=True)
        class Greet:
            """Say a name.

            Example: cipv greet Ada
            """

            name: str = "nobody"

            def __call__(self) -> int:
                print(f"hello {self.name}")
                return 0
        ''',
    )
    monkeypatch.setitem(cli.COMMANDS, "greet", f"{new_module}:Greet")
    with pytest.raises(SystemExit) as end:
        cli.main(["greet", "--name", "Ada"])
    assert not end.value.code
    assert capsys.readouterr().out == "hello Ada\n"
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    assert "greet" in capsys.readouterr().out


def test_a_parameter(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    class WithWaiting(CipvParams):
        wait_s: float = slider(0.5, 0.0, 3.0, 0.1, "s", "A new lead waits this long")

    class Wider(Params):
        cipv: WithWaiting = WithWaiting()

    for user in ("pipeline.params", "app.web.routes.params", "tests.docs.reference_pages"):
        monkeypatch.setattr(f"{user}.Params", Wider)
    changed = PipelineOptions(set=("cipv.wait_s=1.5",)).parameters()
    assert flat(changed)["cipv.wait_s"] == 1.5
    (tmp_path / "mine.yaml").write_text(to_yaml(changed), encoding="utf-8")
    assert from_yaml(tmp_path / "mine.yaml", Wider()) == changed
    with pytest.raises(ParamsError, match=r"cipv\.wait_s"):
        with_changes(changed, {"cipv.wait_s": 4.0})
    (section,) = (each for each in describe() if each["name"] == "cipv")
    (slider_of_it,) = (each for each in section["params"] if each["key"] == "wait_s")
    assert (slider_of_it["min"], slider_of_it["max"], slider_of_it["unit"]) == (0.0, 3.0, "s")
    assert "| `cipv.wait_s` | 0.5 |  | 0 – 3 | s | A new lead waits this long |" in parameters_page()


def test_an_api_route(monkeypatch: pytest.MonkeyPatch) -> None:
    def frames_router(services: Services) -> APIRouter:
        router = APIRouter(prefix="/api")

        @router.get("/number-of-frames")
        def number() -> int:
            """How many frames the open recording has."""
            return services.engine.snapshot.count

        return router

    monkeypatch.setattr("app.web.server.ROUTERS", [*ROUTERS, frames_router])
    with running(source=Recording(count=5)) as engine:
        app = create_app(engine)
        with serving(app) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            assert client.get("/api/number-of-frames").json() == 5
        assert "/api/number-of-frames" in app.openapi()["paths"]
