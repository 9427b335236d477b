"""The folder of a batch in a store: what it asks of the store."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import NotReachable


@pytest.fixture
def store() -> Iterator[Store]:
    memory = fsspec.filesystem("memory")
    yield Store("memory://fleet/out")
    memory.store.clear()


def test_a_file_that_is_not_there_takes_one_request(store: Store, monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []
    honest = store.system.cat_file

    def counted(path: str) -> bytes:
        asked.append(path)
        return bytes(honest(path))

    monkeypatch.setattr(store.system, "cat_file", counted)
    monkeypatch.setattr(store.system, "info", lambda path, **_: asked.append(path))
    assert store.read("none.json") is None
    assert asked == [store.path("none.json")]


def test_a_file_that_may_not_be_read_is_not_taken_for_a_missing_one(store: Store, monkeypatch: pytest.MonkeyPatch):
    def denied(_: str) -> bytes:
        raise PermissionError("Forbidden")

    store.write("a.json", b"{}")
    monkeypatch.setattr(store.system, "cat_file", denied)
    with pytest.raises(BadInput, match=r"a\.json: access denied"):
        store.read("a.json")
    assert store.read("none.json") is None, "some stores deny access to what is not there"


def test_a_store_whose_package_is_missing_is_named_at_once(monkeypatch: pytest.MonkeyPatch):
    waited: list[float] = []

    def missing(address: str) -> None:
        raise ImportError("Install adlfs to access Azure")

    monkeypatch.setattr("fsspec.core.url_to_fs", missing)
    monkeypatch.setattr("time.sleep", waited.append)
    with pytest.raises(NotReachable, match=r"^az://fleet/out: Install adlfs"):
        Store("az://fleet/out").read("a.json")
    assert waited == []


@pytest.mark.parametrize("in_a_store", [True, False])
def test_several_files_are_put_at_once(store: Store, tmp_path: Path, in_a_store: bool):
    files = {f"tables/{n}.bin": tmp_path / f"{n}" for n in range(7)}
    for n, file in enumerate(files.values()):
        file.write_bytes(bytes([n]) * 1000)
    target = store if in_a_store else Store(str(tmp_path / "out"))
    target.put_all(files)
    target.put_all({})
    assert {name: target.read(name) for name in target.names("tables")} == {
        name: file.read_bytes() for name, file in files.items()
    }


def test_a_file_that_cannot_be_put_is_named(tmp_path: Path):
    (tmp_path / "out").write_text("a file, not a folder")
    (tmp_path / "a").write_text("a")
    with pytest.raises(BadInput, match=r"out/a\.bin cannot be written"):
        Store(str(tmp_path / "out")).put_all({"a.bin": tmp_path / "a"})
