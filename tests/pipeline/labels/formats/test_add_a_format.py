"""A format of labels is added in one file and one registration."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.labels.formats import registry
from pipeline.labels.formats.registry import FORMATS, LabelFormat, export_labels, import_labels
from pipeline.labels.model import Origin
from tests.pipeline.labels.formats.sets import drive
from tests.pipeline.labels.formats.test_round_trip import full_set

ROOT = Path(__file__).parents[4]

ONE_FILE = """
import json

from pipeline.labels.formats.base import Imported, write_file


def write(labels, drive, out):
    write_file(out, json.dumps([track.label for track in labels.tracks]).encode())
    return ()


def read(path, drive, origin):
    return Imported(drive.empty(), (f"{len(json.loads(path.read_bytes()))} names are not kept",))
"""
ONE_REGISTRATION = LabelFormat(
    "names", "Names", "what there is", ".json", frozenset(("cuboids", "boxes")), "names_of_things:write",
    "names_of_things:read",
)  # fmt: skip


@pytest.fixture(autouse=True)
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The new format."""
    (tmp_path / "names_of_things.py").write_text(ONE_FILE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(FORMATS, "names", ONE_REGISTRATION)
    yield
    sys.modules.pop("names_of_things", None)


def test_it_is_written_and_read(tmp_path: Path) -> None:
    lost = export_labels(full_set(), drive(), "names", tmp_path / "labels.json")
    assert any("path" in sentence for sentence in lost), "what it cannot hold is said as of any other format"
    assert json.loads((tmp_path / "labels.json").read_bytes())
    found = import_labels(tmp_path / "labels.json", drive(), "names", Origin("import", "a test", 0))
    assert "names are not kept" in found.notes[0]


def test_the_page_has_no_list_of_its_own() -> None:
    modules = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "static" / "js").rglob("*.js"))
    assert "api/labels/formats" in modules
    assert [kind.name for kind in FORMATS.values() if f'"{kind.about}"' in modules] == []


@pytest.mark.parametrize("name", list(FORMATS))
def test_every_registration_names_functions_that_exist(name: str) -> None:
    kind = registry.FORMATS[name]
    assert callable(registry._imported(kind.writer))
    assert callable(registry._imported(kind.reader))
    assert kind.title
    assert kind.about
