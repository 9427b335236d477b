"""Every address of the server and every word of the stream, with who may use it. Made from the routes themselves: one
that is added without a rule here fails."""

from __future__ import annotations

import asyncio
import inspect
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

import pytest
from starlette.routing import Mount
from starlette.types import Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from app.core.client_role import ACCOUNT_ROLES, Account, AccountRole, Role
from app.engine.engine import Engine
from app.labels.acts.requests import Act
from app.labels.errors import NotAllowed
from app.labels.permissions import check_act
from app.streaming.scene_requests import hear
from app.streaming.slot import FrameCounts, Slot
from app.streaming.stream import MAY_SAY, Stream
from app.web.guards.access import Access, Guard
from app.web.guards.accounts import Accounts, add_account
from app.web.guards.tokens import Tokens
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener

Rule = Literal["everybody", "whoever looks", "people", "reviewers"]
TOKENS = Tokens("person-0123456789abcdef", "display-0123456789abcde")

EVERYBODY = "GET /healthz · HEAD /healthz"
WHOEVER_LOOKS = """
GET /api/healthz · GET /metrics · GET /api/state · GET /api/result · GET /api/sources · GET /api/params ·
GET /api/params.yaml · GET /api/recording · POST /api/recording · GET /api/drive · GET /api/drive/object/{object_id} ·
GET /api/drive/events · POST /api/marks · GET /api/runs · GET /api/runs/{number}/columns ·
GET /api/runs/{number}/params.yaml · GET /api/compare · GET /api/labels · GET /api/labels/frames ·
GET /api/labels/tracks/{number} · GET /api/labels/tracks/{number}/filmstrip ·
GET /api/labels/tracks/{number}/close_up · GET /api/labels/checks · GET /api/labels/classes ·
GET /api/labels/next · GET /api/labels/queue · GET /api/labels/projects · GET /api/account ·
GET /api/labels/score · GET /api/labels/history ·
GET /api/labels/formats · GET /api/labels/export · GET /api/labels/export/notes · GET /api/labels/versions ·
GET /api/labels/versions/{name} · GET /api/labels/agreement ·
GET /api/jobs · GET /api/jobs/{number} · GET /api/jobs/{number}/file ·
GET /api/alignment/score · GET /api/alignment/fit · GET /api/alignment/fit.yaml · GET /api/alignment/versions ·
GET /api/alignment/time · GET /api/alignment/export ·
GET /api/rerun/open · GET /api/rerun.rrd · GET /openapi.json · HEAD /openapi.json ·
WEBSOCKET /api/stream · GET /rerun/re_viewer.js · GET /rerun/re_viewer_bg.wasm · GET /rerun/ · GET /help ·
GET /help/{address:path} · GET /palette.css · GET / · HEAD /
"""
PEOPLE = """
POST /api/playback · POST /api/source · PATCH /api/params · POST /api/params · POST /api/params/undo ·
POST /api/params/redo · POST /api/params/preset · DELETE /api/marks/{number} · POST /api/runs/{number}/keep ·
POST /api/runs/{number}/base · POST /api/runs/{number}/use · DELETE /api/runs/{number} · POST /api/labels/act ·
POST /api/labels/queue · POST /api/labels/undo · POST /api/labels/redo · POST /api/clip ·
DELETE /api/jobs/{number} · POST /api/alignment/fit · POST /api/alignment/time · DELETE /api/alignment/time ·
DELETE /api/alignment/fit · POST /api/alignment/import · POST /api/alignment/pairs ·
POST /api/alignment/versions · DELETE /api/alignment/versions/{number} ·
POST /api/project · POST /api/project/ray · WEBSOCKET /viser · WEBSOCKET /viser/ · GET /api/fleet ·
GET /api/fleet/rows · GET /api/fleet/histogram · GET /api/fleet/counts · WEBSOCKET /viser/of/{name} ·
GET /viser/of/{name}/{path:path} · GET /viser · GET /viser/{path:path}
"""
REVIEWERS = "GET /api/labels/control · POST /api/labels/import · POST /api/labels/versions"
RULES: dict[str, Rule] = {
    door.strip(): rule
    for rule, doors in (
        ("everybody", EVERYBODY),
        ("whoever looks", WHOEVER_LOOKS),
        ("people", PEOPLE),
        ("reviewers", REVIEWERS),
    )
    for door in doors.split("·")
}  # type: ignore[assignment]
WELCOME: dict[Rule, set[str]] = {
    "everybody": {"nobody", "display", "person", *ACCOUNT_ROLES},
    "whoever looks": {"display", "person", *ACCOUNT_ROLES},
    "people": {"person", *ACCOUNT_ROLES},
    "reviewers": {"person", "reviewer", "admin"},
}


@pytest.fixture(scope="module")
def tokens(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The token of each role, for accounts from a file."""
    file = tmp_path_factory.mktemp("accounts") / "accounts.json"
    made = {role: add_account(f"a {role}", role, file) for role in ACCOUNT_ROLES}
    return made | {"person": TOKENS.person, "display": TOKENS.display, "file": str(file)}


def doors_of(routes: Any) -> Iterator[str]:
    for route in routes:
        inside = getattr(route, "original_router", None)
        if inside is not None:
            yield from doors_of(inside.routes)
        elif isinstance(route, Mount):
            yield from (f"{method} {route.path or '/'}" for method in ("GET", "HEAD"))
        else:
            yield from (f"{method} {route.path}" for method in getattr(route, "methods", None) or ("WEBSOCKET",))


def test_every_address_has_a_rule():
    app = create_app(Engine(opener(Recording()), None, Params()))
    described = {f"{method.upper()} {path}" for path, methods in app.openapi()["paths"].items() for method in methods}
    assert set(doors_of(app.routes)) | described == set(RULES)


async def _inside(_: Scope, receive: Receive, send: Send) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})


def lets_in(door: str, token: str | None, guarded: Tokens) -> bool:
    """Whether the request passes the guard."""
    method, _, path = door.partition(" ")
    path = re.sub(r"\{[^}]*\}", "1", path)
    headers = [(b"host", b"127.0.0.1:8420")] + ([(b"authorization", f"Bearer {token}".encode())] if token else [])
    kind = "websocket" if method == "WEBSOCKET" else "http"
    scope = {
        "type": kind, "method": method, "path": path, "query_string": b"", "headers": headers, "client": ("::1", 1),
        "server": ("127.0.0.1", 8420), "scheme": "http",
    }  # fmt: skip
    sent: list[Message] = []

    async def ask() -> None:
        async def send(message: Message) -> None:
            sent.append(message)

        async def receive() -> Message:
            return {"type": "websocket.connect"}

        await Guard(_inside, Access(["0.0.0.0"]), guarded)(scope, receive, send)

    asyncio.run(ask())
    return sent[0].get("status") == 200


@pytest.mark.parametrize("role", ["nobody", "display", "person", *ACCOUNT_ROLES])
def test_the_guard_lets_in_whom_the_rules_do_and_nobody_else(role: str, tokens: dict[str, str]):
    guarded = replace(TOKENS, accounts=Accounts(Path(tokens["file"])))
    wrong = [
        door for door, rule in RULES.items() if lets_in(door, tokens.get(role), guarded) != (role in WELCOME[rule])
    ]
    assert wrong == []


ACTS: dict[str, AccountRole] = {
    "review_ok": "reviewer",
    "send_back": "reviewer",
    "import": "reviewer",
    "clear_all": "reviewer",
}
"""Every account may do all other acts."""


@pytest.mark.parametrize("role", ACCOUNT_ROLES)
def test_every_act_on_labels_has_a_rule(role: AccountRole):
    kinds = {get_args(each.model_fields["kind"].annotation)[0] for each in get_args(get_args(Act)[0])}
    assert set(ACTS) < kinds

    def may(kind: str) -> bool:
        try:
            check_act(Account("Ada", role), kind)
        except NotAllowed:
            return False
        return True

    assert {kind for kind in kinds if not may(kind)} == (set(ACTS) if role == "labeler" else set())


WORDS: dict[str, Rule] = {
    "ping": "whoever looks",
    "picture_px": "whoever looks",
    "painted": "whoever looks",
    "selected": "people",
    "hides_3d": "people",
    "held": "people",
    "page_3d": "people",
    "labels_3d": "people",
    "own": "people",
}


def test_every_word_of_the_stream_has_a_rule():
    source = inspect.getsource(Stream._receive) + inspect.getsource(hear)
    heard = set(re.findall(r"""said(?:\.get\(|\[)"(\w+)\"""", source))
    assert heard == set(WORDS)
    assert MAY_SAY["person"] == set(WORDS)
    assert MAY_SAY["display"] == {word for word, rule in WORDS.items() if rule == "whoever looks"}


class _Page:
    """A WebSocket of a role that sends one message and disconnects."""

    def __init__(self, role: Role, said: dict[str, object]) -> None:
        self.scope = {"type": "websocket", "state": {"role": role}}
        self.state = self.scope["state"]
        self._messages = iter([{"type": "websocket.receive", "text": json.dumps(said)}])

    async def receive(self) -> Message:
        return next(self._messages, {"type": "websocket.disconnect"})


@pytest.mark.parametrize("role", ["display", "person"])
def test_a_word_without_a_rule_is_read_by_nothing(role: Role, monkeypatch: pytest.MonkeyPatch):
    heard: dict[str, object] = {}
    monkeypatch.setattr("app.streaming.stream.hear", lambda looks, page, said: heard.update(said))
    page = _Page(role, dict.fromkeys([*WORDS, "a word that somebody adds"]))
    asyncio.run(Stream()._receive(cast("WebSocket", page), Slot(True, FrameCounts())))
    assert set(heard) == {word for word, rule in WORDS.items() if role in WELCOME[rule]}
