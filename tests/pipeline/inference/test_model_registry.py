"""Fetching is tried against a real server on the loopback interface."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from pipeline.inference import model_registry
from pipeline.inference.runtime import DetectorError, read_graph

CONTENT = bytes(range(256)) * 1000


class _Handler(BaseHTTPRequestHandler):
    """Answers by the first part of the path."""

    def do_GET(self) -> None:
        kind = self.path.strip("/")
        if kind == "missing":
            self.send_error(404)
            return
        body = {"good": CONTENT, "short": CONTENT[:-1000], "wrong": CONTENT[::-1], "long": CONTENT + b"x"}[kind]
        self.send_response(200)
        self.send_header("Content-Length", str(len(body) + (500 if kind == "cut" else 0)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture(autouse=True)
def _own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("CIPV_DATA", str(tmp_path / "data"))


def _known(monkeypatch: pytest.MonkeyPatch, url: str) -> None:
    """The entry of yolox_nano, as if its official file were at ``url``."""
    nano = replace(model_registry.KNOWN[0], url=url, size=len(CONTENT), sha256=hashlib.sha256(CONTENT).hexdigest())
    monkeypatch.setattr(model_registry, "KNOWN", (nano, *model_registry.KNOWN[1:]))


def _files() -> list[str]:
    return sorted(path.name for path in model_registry.store().glob("*"))


def test_a_good_file_is_kept_and_becomes_the_default(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    _known(monkeypatch, f"{address}/good")
    assert model_registry.default_model("detector") == model_registry.find("embedded")
    steps: list[tuple[int, int]] = []
    path = model_registry.pull("yolox_nano", lambda done, total: steps.append((done, total)))
    assert path.read_bytes() == CONTENT
    assert path == model_registry.store() / "yolox_nano.onnx"
    assert steps[-1] == (len(CONTENT), len(CONTENT))
    assert [done for done, _ in steps] == sorted({done for done, _ in steps})
    assert model_registry.default_model("detector") == path
    assert model_registry.default_model("lanes") is None


def test_what_is_there_and_right_is_not_fetched_again(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    _known(monkeypatch, f"{address}/good")
    model_registry.pull("yolox_nano")
    _known(monkeypatch, f"{address}/missing")
    assert model_registry.pull("yolox_nano").read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        ("missing", "answered 404"),
        ("short", "255000 of 256000 bytes"),
        ("long", "more than 256000 bytes"),
        ("wrong", "is not the official file"),
    ],
)
def test_a_failed_fetch_says_why_and_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, address: str, kind: str, complaint: str
) -> None:
    _known(monkeypatch, f"{address}/{kind}")
    with pytest.raises(model_registry.ModelError, match=complaint):
        model_registry.pull("yolox_nano")
    assert _files() == []


def test_a_damaged_file_is_replaced_only_by_a_right_one(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    model_registry.store().mkdir(parents=True)
    (model_registry.store() / "yolox_nano.onnx").write_bytes(b"old")
    _known(monkeypatch, f"{address}/wrong")
    with pytest.raises(model_registry.ModelError):
        model_registry.pull("yolox_nano")
    assert (model_registry.store() / "yolox_nano.onnx").read_bytes() == b"old"
    _known(monkeypatch, f"{address}/good")
    assert model_registry.pull("yolox_nano").read_bytes() == CONTENT


def test_without_a_network_connection_the_way_around_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    _known(monkeypatch, "http://127.0.0.1:1/nobody-listens")
    with pytest.raises(model_registry.ModelError, match=r"cannot be downloaded .*cipv models register PATH yolox_nano"):
        model_registry.pull("yolox_nano")
    assert _files() == []


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(
        model_registry.ModelError, match=r"no network named 'yolo99'; known are yolox_nano, .*twinlitenet"
    ):
        model_registry.pull("yolo99")


def test_a_registered_file_is_found_by_name_and_is_the_default(tmp_path: Path) -> None:
    mine = tmp_path / "best.onnx"
    mine.write_bytes(b"mine")
    stored = model_registry.register(mine, "my-van-detector")
    mine.unlink()
    assert stored.read_bytes() == b"mine"
    assert model_registry.find("my-van-detector") == stored == model_registry.default_model("detector")
    row = next(entry for entry in model_registry.list_models() if entry.name == "my-van-detector")
    assert (row.path, row.default, row.task) == (stored, True, "detector")


def test_registering_beside_keeps_the_default(tmp_path: Path) -> None:
    for name in ("first", "second"):
        (tmp_path / name).write_bytes(name.encode())
    model_registry.register(tmp_path / "first", "first")
    model_registry.register(tmp_path / "second", "second", default=False)
    assert model_registry.default_model("detector") == model_registry.find("first")


def test_a_stored_file_can_be_made_the_default_in_place(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"a")
    stored = model_registry.register(tmp_path / "a.onnx", "a", default=False)
    assert model_registry.default_model("detector") == model_registry.find("embedded")
    model_registry.register(stored, "a")
    assert model_registry.default_model("detector") == stored
    assert stored.read_bytes() == b"a"


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden", "two words"])
def test_a_name_that_is_a_path_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.onnx").write_bytes(b"a")
    with pytest.raises(model_registry.ModelError, match="is not a valid network name"):
        model_registry.register(tmp_path / "a.onnx", name)
    assert model_registry.find(name) is None


def test_the_embedded_name_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"a")
    with pytest.raises(model_registry.ModelError, match="built-in detector"):
        model_registry.register(tmp_path / "a.onnx", "embedded")


def test_the_embedded_detector_is_here_and_listed_and_the_last_resort(tmp_path: Path) -> None:
    path = model_registry.find("embedded")
    assert path is not None
    assert path.stat().st_size < 3_000_000
    row = next(entry for entry in model_registry.list_models() if entry.name == "embedded")
    assert (row.path, row.default, row.task) == (path, True, "detector")
    (tmp_path / "a.onnx").write_bytes(b"a")
    model_registry.register(tmp_path / "a.onnx", "mine")
    assert not next(entry for entry in model_registry.list_models() if entry.name == "embedded").default


def test_registering_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(model_registry.ModelError, match="no file at"):
        model_registry.register(tmp_path / "nothing.onnx", "nothing")


def test_the_data_folder_is_looked_in_last(tmp_path: Path) -> None:
    folder = tmp_path / "data" / "models"
    folder.mkdir(parents=True)
    (folder / "yolox_tiny.onnx").write_bytes(b"tiny")
    assert model_registry.default_model("detector") == model_registry.find("yolox_tiny") == folder / "yolox_tiny.onnx"
    (tmp_path / "own.onnx").write_bytes(b"own")
    assert model_registry.register(tmp_path / "own.onnx", "own") == model_registry.default_model("detector")


def test_the_list_names_every_known_network_and_what_is_here(tmp_path: Path) -> None:
    *entries, embedded = model_registry.list_models()
    assert embedded.name == "embedded"
    assert [entry.name for entry in entries] == [
        "yolox_nano",
        "yolox_tiny",
        "yolox_s",
        "twinlitenet",
        "twinlitenetplus_small",
        "lstr_360x640",
        "yolop",
        "ufld",
        "enet_sad",
    ]
    assert all(entry.path is None and not entry.default for entry in entries)
    assert all(entry.licence and entry.url and entry.url.startswith("https://github.com/") for entry in entries)


def test_a_network_without_an_official_file_says_how_to_get_one() -> None:
    with pytest.raises(
        model_registry.ModelError,
        match=r"then `cipv models register PATH ufld --task lanes`; see https://\S+",
    ):
        model_registry.pull("ufld")
    assert _files() == []


def test_a_damaged_registry_is_named(tmp_path: Path) -> None:
    model_registry.store().mkdir(parents=True)
    (model_registry.store() / "registry.json").write_text("{", encoding="utf-8")
    with pytest.raises(model_registry.ModelError, match=r"registry\.json is damaged"):
        model_registry.default_model("detector")


def test_a_registry_that_cannot_be_read_is_not_a_damaged_one():
    (model_registry.store() / "registry.json").mkdir(parents=True)
    with pytest.raises(model_registry.ModelError, match=r"registry\.json cannot be read: Is a directory"):
        model_registry.default_model("detector")


def test_damaged_lists_of_networks_are_said(tmp_path: Path):
    (tmp_path / "home" / "models").mkdir(parents=True)
    for text in (
        '{"models": {"a": 1}}',
        '{"defaults": {"detector": 7}}',
        "[]",
        '{"defaults": {"detector": "../x"}}',
        "\\udc80",
    ):
        (tmp_path / "home" / "models" / "registry.json").write_text(text)
        with pytest.raises(model_registry.ModelError, match="is damaged"):
            model_registry.list_models()


def test_weights_that_changed_since_they_were_installed_are_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "mine.onnx").write_bytes(CONTENT)
    installed = model_registry.register(tmp_path / "mine.onnx", "mine")
    assert model_registry.read_verified(installed) == CONTENT
    _known(monkeypatch, "")
    pulled = installed.with_name("yolox_nano.onnx")
    for path in (installed, pulled):
        path.write_bytes(CONTENT[:5000] + bytes(4000) + CONTENT[9000:])
        with pytest.raises(model_registry.ModelError, match="damaged or was changed"):
            model_registry.read_verified(path)
    with pytest.raises(DetectorError, match="damaged or was changed"):
        read_graph(installed)
    pulled.write_bytes(CONTENT)
    assert model_registry.read_verified(pulled) == CONTENT


def test_an_installed_network_is_checked_by_whatever_path_it_is_opened(tmp_path: Path):
    (tmp_path / "mine.onnx").write_bytes(CONTENT)
    installed = model_registry.register(tmp_path / "mine.onnx", "mine")
    link, hard, elsewhere = tmp_path / "link.onnx", tmp_path / "hard.onnx", tmp_path / "elsewhere"
    link.symlink_to(installed)
    hard.hardlink_to(installed)
    assert model_registry.read_verified(link) == CONTENT
    installed.rename(elsewhere)
    installed.symlink_to(elsewhere)
    elsewhere.write_bytes(CONTENT[::-1])
    for path in (link, hard, installed):
        with pytest.raises(model_registry.ModelError, match="damaged or was changed"):
            model_registry.read_verified(path)


def test_the_embedded_network_is_the_one_that_its_law_was_fitted_to():
    embedded = model_registry.find(model_registry.EMBEDDED)
    assert embedded is not None
    assert model_registry.read_verified(embedded)


def test_another_file_of_an_official_name_has_not_its_licence(tmp_path: Path):
    (tmp_path / "data" / "models").mkdir(parents=True)
    (tmp_path / "data" / "models" / "yolox_nano.onnx").write_bytes(CONTENT)
    listed = next(each for each in model_registry.list_models() if each.name == "yolox_nano")
    assert listed.path is not None
    assert (listed.licence, listed.url) == (None, None)
    assert listed.note.startswith("not the official file")
