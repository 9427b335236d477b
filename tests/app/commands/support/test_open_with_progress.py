"""Bars on standard error."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from app.commands.support import open_with_progress as progress
from app.commands.support import progress_bars
from pipeline.common.progress import Progress
from pipeline.types.source import AnySource, SourceError
from tests.app.engine.recording_helpers import Recording


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """The output to a terminal."""
    text = io.StringIO()

    def console(**_: Any) -> Console:
        return Console(file=text, force_terminal=True, width=100)

    monkeypatch.setattr(progress_bars, "Console", console)
    return text


def test_a_bar_shows_how_much_of_a_file_was_read(terminal: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    def open_any(uri: str, *, rings: int, progress: Progress) -> AnySource:
        assert rings == 64
        for done in (0, 30, 80):
            progress(done, 100)
        return Recording(uri)

    monkeypatch.setattr(progress, "open_any", open_any)
    assert progress.opened("pcap:/data/drive.pcap?port=2368", 64).uri == "pcap:/data/drive.pcap?port=2368"
    assert "reading drive.pcap" in terminal.getvalue()
    assert "80%" in terminal.getvalue()


def test_what_is_opened_at_once_shows_no_bar(terminal: io.StringIO) -> None:
    assert len(progress.opened_recording("sim:straight")) > 0
    assert terminal.getvalue() == ""


def test_what_cannot_be_opened_is_said_with_or_without_a_bar(
    terminal: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    def open_any(uri: str, *, rings: int, progress: Progress) -> AnySource:
        progress(1, 2)
        raise SourceError("cut off")

    monkeypatch.setattr(progress, "open_any", open_any)
    with pytest.raises(SourceError, match="cut off"):
        progress.opened("pcap:a.pcap")
    with pytest.raises(SourceError, match="no such file"):
        progress.opened_recording("pcap:nothing.pcap")
