"""A kind of source is added in one file and one registration: then every command and the page know it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from app.commands.serve import Serve
from app.web.source_catalog import catalog
from pipeline import source_kinds
from pipeline.source_kinds import KINDS, SourceKind, looks_like, usages
from pipeline.sources import SourceError, open_any, open_source

ONE_FILE = '''
from pipeline.types import Frame
from pipeline.types.source import SourceError


class Diary:
    """A recording that holds nothing but the names of its frames."""

    rate_hz, notes = 10.0, ()

    def __init__(self, uri, path):
        try:
            with open(path) as file:
                self.names = file.read().split()
        except OSError as error:
            raise SourceError(f"{path}: {error.strerror}") from None
        self.uri, self.title = uri, path

    def __len__(self):
        return len(self.names)

    def t_ns(self, index):
        return index * 100_000_000

    def frame(self, index):
        return Frame(index, self.names[index], self.t_ns(index))

    def truth(self, index):
        return None


def open_recording(uri, rest, how):
    return Diary(uri, rest)
'''
ONE_REGISTRATION = SourceKind("diary", "diary:<file>", "diary_of_a_stranger:open_recording", suffixes=(".diary",))


@pytest.fixture
def diary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording of the new kind."""
    (tmp_path / "diary_of_a_stranger.py").write_text(ONE_FILE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(source_kinds, "KINDS", (*KINDS, ONE_REGISTRATION))
    data = tmp_path / "data"
    data.mkdir()
    (data / "monday.diary").write_text("one two three")
    monkeypatch.setenv("CIPV_DATA", str(data))
    return data / "monday.diary"


def test_it_is_opened_by_its_uri_and_imported_only_then(diary: Path) -> None:
    assert looks_like(diary) == "diary"
    assert "diary_of_a_stranger" not in sys.modules
    try:
        source = open_source(f"diary:{diary}")
        assert [source.frame(index).name for index in range(len(source))] == ["one", "two", "three"]
        assert type(open_any(f"diary:{diary}")) is type(source)
    finally:
        del sys.modules["diary_of_a_stranger"]


def test_it_is_served_like_any_other(diary: Path) -> None:
    engine = Serve(f"diary:{diary}").engine()
    assert engine is not None
    with pytest.raises(SourceError, match="No such file"):
        Serve("diary:nowhere").engine()
    del sys.modules["diary_of_a_stranger"]


def test_the_page_and_the_errors_list_it(diary: Path) -> None:
    assert (f"diary:{diary}", "diary · monday.diary") in catalog()
    assert usages().endswith("diary:<file>")
    assert type(open_source(str(diary))) is type(open_source(f"diary:{diary}"))
    with pytest.raises(SourceError, match="diary:<file>"):
        open_source("nosuch:thing")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.scheme)
def test_every_registration_names_a_function_that_exists(kind: SourceKind) -> None:
    assert callable(kind.load())
    assert all(uri.startswith(f"{kind.scheme}:") for uri, _ in kind.offers())


def test_schemes_are_told_apart() -> None:
    assert len({kind.scheme for kind in KINDS}) == len(KINDS)
