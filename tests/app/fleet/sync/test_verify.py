"""Copies of equal size that are damaged are found when asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.fleet.store import Store
from tests.app.fleet.s3 import s3_server
from tests.app.fleet.sync.copies import S3, synced


def spoil_copy(address: str, name: str) -> bytes:
    """Change one byte of a file in a store. Returns what it was."""
    store = Store(address)
    data = store.read(name)
    assert data is not None
    store.write(name, data[:99] + bytes([data[99] ^ 1]) + data[100:])
    return data


def check_damaged(car: Path, address: str) -> None:
    """Check that a copy of equal size with another byte is noticed when asked for, and sent again."""
    synced(car, address, clips=False)
    before = spoil_copy(address, "sessions/a.mcap")
    assert synced(car, address, clips=False)[1] == [], "sizes are equal"
    sync, begun = synced(car, address, clips=False, verify=True)
    assert sync.tally.damaged == ["a"]
    assert [what for what, _ in begun] == ["checking may/b", "checking a", "a"]
    assert Store(address).read("sessions/a.mcap") == before
    assert synced(car, address, clips=False, verify=True)[0].tally.damaged == []


def test_a_damaged_copy_in_a_folder_is_sent_again(car: Path, tmp_path: Path):
    check_damaged(car, str(tmp_path / "nas"))


def test_a_damaged_copy_in_a_store_is_sent_again(car: Path, in_memory: str):
    check_damaged(car, in_memory)


def test_a_damaged_copy_in_s3_is_sent_again(car: Path, monkeypatch: pytest.MonkeyPatch):
    with s3_server(monkeypatch, every=7):
        check_damaged(car, S3)


def test_a_damaged_copy_is_not_replaced_by_what_was_never_sent(car: Path, tmp_path: Path):
    address = str(tmp_path / "nas")
    synced(car, address, clips=False)
    spoil_copy(address, "sessions/a.mcap")
    spoil_copy(str(car), "a.mcap")
    sync, _ = synced(car, address, clips=False, verify=True)
    assert sync.tally.sessions == 0
    assert "is not what was sent" in sync.tally.failed["a"]
