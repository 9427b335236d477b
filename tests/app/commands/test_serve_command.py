"""`cipv serve`: what it opens, and how often."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import app.commands.serve as command
from app.commands.record import Record
from app.commands.run import RunPipeline
from app.commands.serve import Serve
from app.commands.support.options import SourceOptions
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress
from pipeline.types.source import AnySource, SourceError
from tests.app.engine.recording_helpers import CountingDetector, Recording

WAIT_S = 180.0
Opened = list[str]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Opened:
    """URIs in the order in which they were opened; each is a separate recording."""
    uris: Opened = []

    def open_any(uri: str, *, rings: int, progress: Progress) -> AnySource:
        uris.append(uri)
        if uri == "test:nothing":
            raise SourceError("test:nothing: no such file")
        return Recording(uri)

    monkeypatch.setattr(command, "open_any", open_any)
    monkeypatch.setattr("app.commands.support.open_with_progress.open_any", open_any)
    monkeypatch.setattr(command, "detector_for", lambda source, name: CountingDetector())
    monkeypatch.setattr(command, "lanes_for", lambda source, name: None)
    return uris


def test_a_recording_is_opened_once_for_all_who_read_it(opened: Opened) -> None:
    engine = Serve("test:one").engine()
    assert opened == ["test:one"], "a typing mistake is said before anything is started"
    engine.start()
    try:
        engine.wait_for(lambda s: s.drive.total > 0 and s.drive.phase == "done", WAIT_S)
        assert opened == ["test:one"]
        engine.control.change(uri="test:two")
        engine.wait_for(lambda s: s.uri == "test:two" and s.drive.phase == "done" and s.drive.done == 30, WAIT_S)
        engine.control.change(uri="test:one")
        engine.wait_for(lambda s: s.uri == "test:one", WAIT_S)
        assert opened == ["test:one", "test:two", "test:one"], "asked for again, it may be another by now"
    finally:
        engine.stop()


def test_what_cannot_be_opened_is_said_before_anything_starts(opened: Opened) -> None:
    with pytest.raises(BadInput, match="no such file"):
        Serve("test:nothing").engine()


FOO = SourceOptions("foo")


@pytest.mark.parametrize("begin", [Serve("foo").engine, Record(FOO), RunPipeline(FOO)], ids=["serve", "record", "run"])
def test_who_takes_live_sensors_names_them_among_what_can_be_typed(begin: Callable[[], object]) -> None:
    with pytest.raises(SourceError, match=r"foo: not a source; use one of .*, live:<config.yaml>$"):
        begin()
