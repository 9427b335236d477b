"""People with accounts: whose token it is, what the file holds, and what each role may do with labels."""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from app.core.client_role import ACCOUNT_ROLES, Account
from app.web.guards.accounts import Accounts, add_account, read_accounts, remove_account
from app.web.guards.tokens import Tokens
from app.web.server import create_app
from pipeline.common.errors import BadInput
from tests.app.web.serving import WAIT_S, running, serving

TAG = {"kind": "tag", "first": 3, "last": 3, "tag": "night"}


def test_the_file_holds_no_token_and_only_its_owner_can_read_it(tmp_path: Path) -> None:
    file = tmp_path / "accounts.json"
    token = add_account("Ada", "labeler", file)
    assert token not in file.read_text()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert Accounts(file).of_token(token) == Account("Ada", "labeler")
    assert Accounts(file).of_token(token[:-1]) is None
    assert Accounts(file).of_token(None) is None


def test_a_running_server_notices_what_is_changed_and_a_damaged_file_lets_nobody_in(tmp_path: Path) -> None:
    file = tmp_path / "accounts.json"
    accounts = Accounts(file)
    ada = add_account("Ada", "labeler", file)
    assert accounts.of_token(ada) == Account("Ada", "labeler")
    newer = add_account("Ada", "reviewer", file)
    assert accounts.of_token(ada) is None, "a new token replaces the old one"
    assert accounts.of_token(newer) == Account("Ada", "reviewer")
    bob = add_account("Bob", "admin", file)
    remove_account("Ada", file)
    assert accounts.of_token(newer) is None
    assert [each.name for each in read_accounts(file)] == ["Bob"]
    file.write_text("[{]")
    assert accounts.of_token(bob) is None
    with pytest.raises(BadInput, match="invalid list of accounts"):
        Accounts(file)


def test_who_is_not_there_cannot_be_removed(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such account"):
        remove_account("Ada", tmp_path / "accounts.json")
    with pytest.raises(BadInput, match="a name is needed"):
        add_account(" ", "labeler", tmp_path / "accounts.json")


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, httpx.Client]]:
    """A client for each role; ``person`` has the token with full access."""
    file = tmp_path_factory.mktemp("accounts") / "accounts.json"
    tokens = Tokens("person-0123456789abcdef", "display-0123456789abcde", accounts=Accounts(file))
    known = {role: add_account(role.title(), role, file) for role in ACCOUNT_ROLES} | {"person": tokens.person}
    with running(whole_drives=True) as engine, serving(create_app(engine, tokens=tokens)) as address:
        engine.wait_for(lambda shown: shown.labels.labelled, WAIT_S)
        clients = {
            role: httpx.Client(base_url=address, timeout=WAIT_S, headers={"authorization": f"Bearer {token}"})
            for role, token in known.items()
        }
        yield clients
        for client in clients.values():
            client.close()


def test_a_body_that_is_nested_too_deeply_is_refused(people: dict[str, httpx.Client]) -> None:
    """To find the name in it, it is parsed before the route sees it."""
    headers = {"content-type": "application/json"}
    answer = people["labeler"].post("/api/labels/act", content=b"[" * 100_000, headers=headers)
    assert 400 <= answer.status_code < 500


def test_an_open_stream_ends_when_its_account_is_removed_or_changed(tmp_path: Path) -> None:
    """It was checked only when it was opened, and lives for days. The others stay."""
    file = tmp_path / "accounts.json"
    tokens = Tokens("person-0123456789abcdef", "display-0123456789abcde", accounts=Accounts(file))
    ada, bob = add_account("Ada", "labeler", file), add_account("Bob", "labeler", file)
    with running() as engine, serving(create_app(engine, tokens=tokens)) as address, ExitStack() as opened:
        url = f"{address.replace('http', 'ws')}/api/stream"
        streams = {
            name: opened.enter_context(connect(url, additional_headers={"authorization": f"Bearer {token}"}))
            for name, token in {"Ada": ada, "Bob": bob, "person": tokens.person, "display": tokens.display}.items()
        }
        remove_account("Ada", file)
        add_account("Bob", "admin", file)
        for gone in ("Ada", "Bob"):
            with suppress(ConnectionClosed):
                while True:
                    streams[gone].recv(WAIT_S)
            assert streams[gone].close_code == 1008
        for name in ("person", "display"):
            streams[name].send('{"ping": 7}')
            while '"pong"' not in str(streams[name].recv(WAIT_S)):
                pass


def drive(client: httpx.Client) -> str:
    found: str = client.get("/api/labels").json()["drive"]["id"]
    return found


def act(client: httpx.Client, person: str, act: dict[str, Any]) -> httpx.Response:
    return client.post("/api/labels/act", json={"person": person, "drive": drive(client), "act": act})


def test_everybody_is_told_who_they_are(people: dict[str, httpx.Client]) -> None:
    told = {role: client.get("/api/account").json() for role, client in people.items()}
    assert told == {role: {"name": role.title(), "role": role} for role in ACCOUNT_ROLES} | {
        "person": {"name": None, "role": None}
    }


def test_nobody_acts_under_the_name_of_somebody_else(people: dict[str, httpx.Client]) -> None:
    ada = people["labeler"]
    assert act(ada, "Labeler", TAG).status_code == 200
    requests = (
        act(ada, "Admin", TAG),
        act(ada, " Admin\n", TAG),
        ada.post("/api/labels/undo", json={"person": "Admin", "drive": drive(ada)}),
        ada.post("/api/labels/queue", json={"person": "Admin", "drive": "any", "state": "review"}),
        ada.patch("/api/params", json={"person": "Admin", "changes": {"cluster.z_weight": 0.5}}),
        ada.get("/api/labels", params={"person": "Admin"}),
        ada.post(
            "/api/labels/act",
            content=json.dumps({"person": "Admin", "drive": drive(ada), "act": TAG}),
            headers={"content-type": "Application/vnd.x+JSON"},
        ),
    )
    for answer in requests:
        assert (answer.status_code, answer.json()["detail"]) == (403, "you are signed in as Labeler, not as Admin")
    assert act(people["person"], "Whoever", TAG).status_code == 200


def test_a_labeler_does_not_review_and_a_reviewer_does_not_assign(people: dict[str, httpx.Client]) -> None:
    labeler, reviewer, admin = (people[role] for role in ACCOUNT_ROLES)
    added = act(labeler, "Labeler", {"kind": "set_lead", "first": 0, "last": 3, "lead": "none"}).json()
    (lead,) = added["changed"]["leads"]
    approve = {"kind": "review_ok", "items": [{"kind": "lead", "id": lead["id"], "revision": lead["revision"]}]}
    for refused in (approve, {"kind": "import"}):
        answer = act(labeler, "Labeler", refused)
        assert (answer.status_code, answer.json()["detail"]) == (403, "requires the role reviewer")
    assert act(reviewer, "Reviewer", approve).status_code == 200

    def change(client: httpx.Client, person: str, **to: str | bool) -> int:
        body = {"person": person, "drive": drive(client)} | to
        return client.post("/api/labels/queue", json=body).status_code

    assert change(labeler, "Labeler", assign="Labeler") == 200
    assert change(reviewer, "Reviewer", assign="Reviewer") == 403, "it is somebody else's"
    assert change(labeler, "Labeler", assign="Reviewer") == 403
    assert change(labeler, "Labeler", state="review") == 200
    assert change(labeler, "Labeler", state="done") == 403
    assert change(admin, "Admin", assign="Reviewer") == 200
    assert change(reviewer, "Reviewer", state="done") == 409, "nobody reviews their own labels"
    assert act(labeler, "Labeler", {"kind": "set_lead", "first": 4, "last": 5, "lead": "none"}).status_code == 200
    assert change(admin, "Admin", state="done") == 409, "a lead is not reviewed"
    assert change(admin, "Admin", assign="Labeler") == 200
    assert change(reviewer, "Reviewer", state="done", anyway=True) == 403
    assert change(admin, "Admin", state="done", anyway=True) == 200
