"""Addresses of recordings: the same ones from any working folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.fleet.batch.addresses import absolute, recordings
from app.fleet.batch.plan import Plan, begin, work_of
from app.fleet.store import Store
from tests.app.fleet.fleets import plan_of

ODD = ("a b#1.mcap", "q?x.mcap", "pct%20.mcap", "[x].mcap", "star*.mcap", "line\nbreak.mcap", "-dash.mcap", "ü.mcap")


def test_recordings_have_the_same_address_from_any_folder(fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A worker on another machine, or the command that resumes a batch, may have a different working folder."""
    monkeypatch.chdir(fleet.parent)
    relative = (fleet.name, f"{fleet.name}/near-*.mcap", f"mcap:{fleet.name}/near-0.mcap")
    here = recordings(relative[:2])
    plan = Plan(tuple(map(absolute, relative)), plan_of().params, plan_of().choice)
    store = Store(str(tmp_path / "out"))
    begin(plan, work_of(plan, store), store)
    monkeypatch.chdir(tmp_path)
    assert recordings([str(fleet)]) == here
    assert all(Path(each.address).is_file() for each in here)
    assert {each.address for each in work_of(Plan.load(store), store).all} >= {each.address for each in here}


def test_what_is_no_path_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for address in ("sim:straight", "s3://cars/1.mcap", "http://127.0.0.1/a.mcap", "kitti:nowhere"):
        assert absolute(address) == address
    (tmp_path / "drive").mkdir()
    assert absolute("kitti:drive?rate=5") == f"kitti:{tmp_path}/drive?rate=5"
    assert absolute("file:///a/b.mcap") == "/a/b.mcap"


def test_odd_names_are_found_and_told_apart(tmp_path: Path):
    for name in ODD:
        (tmp_path / name).write_bytes(b"x")
    found = recordings([str(tmp_path)])
    assert {Path(each.address).name for each in found} == set(ODD)
    assert len({each.drive for each in found}) == len(ODD)
    assert all(each.drive.replace("-", "").isalnum() and each.drive.isascii() for each in found)
