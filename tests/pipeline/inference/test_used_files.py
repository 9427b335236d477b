from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import onnx
import pytest

from pipeline.inference import used_files
from pipeline.inference.known_networks import KNOWN
from pipeline.inference.model_registry import register, store
from pipeline.inference.used_files import file_notes
from pipeline.vision.detector import open_detector
from tests.pipeline.vision import networks

A, B, C = "a" * 64, "b" * 64, "c" * 64


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A network's file that is not registered."""
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("CIPV_DATA", str(tmp_path / "data"))
    made = tmp_path / "mine.onnx"
    made.write_bytes(b"weights")
    return made


def test_a_change_is_told_with_both_hashes_until_it_is_undone(file: Path) -> None:
    assert file_notes(file, A) == file_notes(file, A) == ()
    (first,) = file_notes(file, B)
    assert first.startswith("mine.onnx has changed")
    assert B[:12] in first
    assert A[:12] in first
    assert file_notes(file, B) == (first,), "the next start says the same"
    assert file_notes(file, A) == (), "restored"
    file_notes(file, B)
    (next_change,) = file_notes(file, C)
    assert B[:12] in next_change


def test_another_network_with_flipped_bytes_still_runs_and_is_named(tmp_path: Path) -> None:
    path = networks.yolox(tmp_path / "tiny.onnx", (64, 64))
    assert not any("changed" in note for note in open_detector(str(path), None).notes)
    model = onnx.load(path)
    weights = next(each for each in model.graph.initializer if len(each.raw_data) >= 4)
    weights.raw_data = bytes([weights.raw_data[0] ^ 1]) + weights.raw_data[1:]
    onnx.save(model, path)
    changed = open_detector(str(path), None)
    assert any(note.startswith("tiny.onnx has changed") and changed.sha256[:12] in note for note in changed.notes)


def test_a_checked_file_needs_no_note(file: Path) -> None:
    installed = register(file, "mine")
    assert file_notes(installed, A) == file_notes(installed, B) == ()


def test_the_content_of_an_official_network_needs_no_note(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(used_files, "KNOWN", (replace(KNOWN[0], sha256=B),))
    assert file_notes(file, A) == file_notes(file, B) == ()


def test_a_damaged_or_unwritable_list_is_no_obstacle(file: Path) -> None:
    file_notes(file, A)
    for text in ("{", "[]", '{"x": 1}', '{"x": {"sha256": 1, "since": "y"}}', '{"x": {"other": "z"}}'):
        (store() / "used.json").write_text(text)
        assert file_notes(file, B) == ()
    (store() / "used.json").unlink()
    (store() / "used.json").mkdir()
    assert file_notes(file, C) == ()


def test_files_that_are_gone_are_forgotten(file: Path) -> None:
    file_notes(file, A)
    other = file.with_name("other.onnx")
    file.rename(other)
    file_notes(other, A)
    assert str(file) not in (store() / "used.json").read_text()
