"""A file of labels on its way in: what becomes of it when it does not come whole, or is not wanted."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from app.labels.service.desk import LabelDesk
from app.web.guards.limits import BodyLimit
from app.web.routes.labels.files import IMPORT, label_files_router
from tests.app.waiting import loop_apart

MOST = 10
"""Maximum size of a file in bytes."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of uploads."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture
def desk() -> Iterator[LabelDesk]:
    """A desk without an open recording."""
    desk = LabelDesk()
    yield desk
    desk.stop()


def upload(desk: LabelDesk, *messages: dict[str, Any]) -> int:
    """Status code of the response to a body that arrives in these pieces."""
    app = FastAPI()
    app.include_router(label_files_router(desk))
    coming, sent = iter(messages), []
    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "POST", "scheme": "http",
        "path": IMPORT, "raw_path": IMPORT.encode(), "root_path": "", "headers": [],
        "query_string": b"person=Ada&drive=a",
        "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 2),
    }  # fmt: skip

    async def receive() -> dict[str, Any]:
        return next(coming)

    async def send(message: Any) -> None:
        sent.append(message)

    with loop_apart() as run:
        run(BodyLimit(app, MOST)(scope, receive, send))
    return int(sent[0]["status"])


def piece(body: bytes, *, more: bool) -> dict[str, Any]:
    return {"type": "http.request", "body": body, "more_body": more}


@pytest.mark.parametrize(
    ("messages", "status"),
    [
        pytest.param([piece(b"half", more=True), {"type": "http.disconnect"}], 400, id="who sends it hangs up"),
        pytest.param([piece(b"half", more=True), piece(b"x" * MOST, more=False)], 413, id="it is too long"),
        pytest.param([piece(b"whole", more=False)], 404, id="nothing is open that it could be of"),
    ],
)
def test_what_is_not_taken_leaves_nothing_behind(
    desk: LabelDesk, folder: Path, messages: list[dict[str, Any]], status: int
) -> None:
    assert upload(desk, *messages) == status
    assert list(folder.iterdir()) == []


def test_it_is_taken_whole_and_others_are_served_meanwhile(
    desk: LabelDesk, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[tuple[bytes, bool]] = []

    def begin(person: str, file: Path, name: str, drive: str | None) -> int:
        taken.append((file.read_bytes(), threading.current_thread() is threading.main_thread()))
        return 1

    monkeypatch.setattr(desk, "begin_import", begin)
    assert upload(desk, piece(b"a ", more=True), piece(b"file", more=False)) == 202
    assert taken == [(b"a file", False)]
    assert [file.read_bytes() for file in folder.iterdir()] == [b"a file"]
