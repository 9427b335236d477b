"""The audit log records who changed, opened or exported something, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from app.web.guards import audit
from app.web.guards.tokens import Tokens
from app.web.server import create_app
from tests.app.waiting import wait_until
from tests.app.web.serving import WAIT_S, running, serving

TOKENS = Tokens("person-0123456789abcdef", "display-0123456789abcde")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "audit.jsonl"


@pytest.fixture
def address(log: Path) -> Iterator[str]:
    with running(whole_drives=True) as engine:
        engine.wait_for(lambda shown: shown.drive.phase == "done" and shown.drive.done == 30, WAIT_S)
        with serving(create_app(engine, tokens=TOKENS, audit=log)) as address:
            yield address


def entries(log: Path, count: int) -> list[dict[str, Any]]:
    """The entries, as soon as there are ``count``: an entry is written after its response was sent."""
    assert wait_until(lambda: log.exists() and log.read_text(encoding="utf-8").count("\n") >= count)
    return [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]


def client(address: str, role: str) -> httpx.Client:
    token = getattr(TOKENS, role)
    return httpx.Client(base_url=address, headers={"authorization": f"Bearer {token}"}, timeout=WAIT_S)


def test_what_a_browser_saves_as_a_file_is_logged_and_what_it_shows_is_not(address: str, log: Path):
    with client(address, "person") as person:
        for path in ("/", "/api/state", "/api/drive", "/api/params", "/metrics", "/help", "/openapi.json"):
            assert person.get(path, follow_redirects=True).status_code == 200
        assert not log.exists()
        number = person.post("/api/clip", json={"first": 0, "last": 3, "kind": "csv"}).json()["id"]
        assert wait_until(lambda: person.get(f"/api/jobs/{number}").json()["state"] == "done")
        files = (
            "/api/params.yaml", "/api/runs/1/params.yaml", "/api/rerun.rrd?first=0&last=1", f"/api/jobs/{number}/file",
        )  # fmt: skip
        for path in files:
            assert person.get(path).status_code == 200
    said = entries(log, 1 + len(files))
    # an entry is written after its answer has left, so the order is not that of the requests
    logged = {(each["method"], each["path"]) for each in said}
    assert logged == {("POST", "/api/clip"), *(("GET", path) for path in files)}
    assert {(each["role"], each["client"]) for each in said} == {("person", "127.0.0.1")}


def test_what_is_opened_and_changed_is_logged_with_who_did_it_and_no_token(address: str, log: Path):
    with client(address, "display") as display, client(address, "person") as person:
        display.post("/api/marks", json={"text": "here"})
        person.post("/api/source", json={"uri": "test:car"}, params={"token": TOKENS.person})
        person.delete("/api/marks/999")
        display.delete("/api/marks/1")
    said = entries(log, 3)
    assert [(each["role"], each["method"], each["path"], each["status"]) for each in said] == [
        ("display", "POST", "/api/marks", 201),
        ("person", "POST", "/api/source", 202),
        ("person", "DELETE", "/api/marks/999", 404),
    ], "what is refused changes nothing"
    assert [json.loads(each["body"] or "null") for each in said] == [{"text": "here"}, {"uri": "test:car"}, None]
    assert TOKENS.person not in log.read_text(encoding="utf-8")


def test_the_3d_view_whose_controls_change_parameters_is_logged_when_it_is_opened(address: str, log: Path):
    headers = {"authorization": f"Bearer {TOKENS.person}", "origin": address}
    url = address.replace("http", "ws")
    with connect(f"{url}/api/stream", additional_headers=headers, max_size=None, open_timeout=WAIT_S) as stream:
        stream.recv(WAIT_S)
    own = {"subprotocols": [Subprotocol("viser-v1")], "open_timeout": WAIT_S}
    with connect(f"{url}/viser/of/abc", additional_headers=headers, **own):
        (entry,) = entries(log, 1)
    assert (entry["role"], entry["method"], entry["path"]) == ("person", "WEBSOCKET", "/viser/of/abc")


def test_nobody_else_reads_it_before_and_after_a_rotation(
    address: str, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit, "_LARGEST_BYTES", 300)
    with running() as engine, serving(create_app(engine, audit=log.with_name("small.jsonl"))) as small:
        for _ in range(5):
            httpx.post(f"{small}/api/marks", json={"text": ""}, timeout=WAIT_S).raise_for_status()
    files = sorted(log.parent.glob("*.jsonl*"))
    assert len(files) >= 4
    assert {file.stat().st_mode & 0o777 for file in files} == {0o600}


@pytest.mark.parametrize("unwritable", ["", "folder/audit.jsonl"])
def test_a_log_that_cannot_be_written_is_said_in_a_line_and_work_goes_on(
    unwritable: str, tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
):
    """A folder is in its place, or a file in that of its folder."""
    (tmp_path / "folder").write_text("")
    with running() as engine, serving(create_app(engine, tokens=TOKENS, audit=tmp_path / unwritable)) as address:
        with client(address, "person") as person:
            assert person.post("/api/playback", json={"playing": False}).is_success
        said = "cannot be written, so changes are not logged: "
        assert wait_until(lambda: any(said in each for each in caplog.messages))
    assert all("\n" not in each for each in caplog.messages)
    assert "Traceback" not in capfd.readouterr().err


def test_nobody_claims_another_address(address: str, log: Path):
    with client(address, "person") as person:
        person.post("/api/playback", json={"playing": False}, headers={"x-forwarded-for": "192.0.2.7"})
    assert [each["client"] for each in entries(log, 1)] == ["127.0.0.1"]
