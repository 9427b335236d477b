"""Saved alignments persist; damaged ones and those that no longer apply are left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.drive import alignment_versions
from app.drive.alignment_versions import LONGEST_NOTE, AlignmentVersions, VersionRefused
from pipeline.params import Params, with_changes

TURNED = with_changes(Params(), {"alignment.yaw_deg": 1.5, "cluster.z_weight": 0.3})


def test_versions_are_kept_and_listed_newest_first(tmp_path: Path):
    file = tmp_path / "sessions" / "alignments.json"
    versions = AlignmentVersions(file)
    versions.add(Params(), "first drive", "2026-01-02T03:04:05+00:00", match=None, iou=None)
    added = versions.add(TURNED, "second", "2026-01-03T03:04:05+00:00", " a  note " + "x" * 300, match=0.9, iou=0.8)
    assert added.note.startswith("a note x")
    assert len(added.note) == LONGEST_NOTE
    again = AlignmentVersions(file).all()
    assert again == versions.all()
    assert [each.id for each in again] == [2, 1]
    assert again[0].values["alignment.yaw_deg"] == 1.5
    assert all(name.startswith("alignment.") for name in again[0].values), "other parameters are none of its business"
    assert with_changes(Params(), again[0].values).alignment == TURNED.alignment
    assert versions.remove(1)
    assert not versions.remove(1)
    assert [each.id for each in AlignmentVersions(file).all()] == [2]


def test_a_damaged_file_and_entries_that_no_longer_apply_are_left_out(tmp_path: Path):
    file = tmp_path / "alignments.json"
    AlignmentVersions(file).add(TURNED, "", "2026", match=None, iou=None)
    rows = json.loads(file.read_text())
    wrong = [rows[0] | {"values": {"alignment.yaw_deg": 400.0}}, {"id": 1}, 7, rows[0] | {"id": float("inf")}]
    file.write_text(json.dumps([*wrong, *rows]))
    assert [each.values["alignment.yaw_deg"] for each in AlignmentVersions(file).all()] == [1.5]
    for damaged in ("{", "[", "17", "", "[" * 100_000):
        file.write_text(damaged)
        assert AlignmentVersions(file).all() == []
        assert not file.exists()
    assert len({each.read_text() for each in tmp_path.glob("*.damaged*")}) == 5, "each is kept"


def test_too_many_and_a_disk_that_refuses_are_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(VersionRefused, match="cannot be saved"):
        AlignmentVersions(tmp_path / "file" / "alignments.json").add(TURNED, "", "", match=None, iou=None)
    monkeypatch.setattr(alignment_versions, "MOST", 1)
    versions = AlignmentVersions()
    versions.add(TURNED, "", "", match=None, iou=None)
    with pytest.raises(VersionRefused, match="delete some"):
        versions.add(TURNED, "", "", match=None, iou=None)
