"""What is sent twice, too late or at the same time: two people, two servers of one team, a server that starts anew."""

from __future__ import annotations

import itertools
from contextlib import ExitStack
from typing import Any
from uuid import UUID

import httpx
import pytest

from app.engine.engine import Engine
from app.labels.store.act_log import Log
from app.labels.store.database import Database, DatabaseError
from tests.app.labels.site import CUBOID, act, labels, move, proposed, team
from tests.app.web.serving import WAIT_S


def test_what_is_sent_again_is_answered_as_before_and_done_once(engine: Engine, client: httpx.Client) -> None:
    drive = labels(client)["drive"]["id"]

    def sent(path: str, person: str = "Ada", **more: Any) -> httpx.Response:
        body = {"person": person, "drive": drive, "act_id": str(UUID(int=number))}
        return client.post(f"/api/labels/{path}", json=body | more)

    numbers = itertools.count(1)
    acts: tuple[tuple[str, dict[str, Any]], ...] = (
        ("act", {"act": {"kind": "tag", "first": 3, "last": 3, "tag": "night"}}),
        ("act", {"act": {"kind": "lift", "frame": 10, "pixel": [160, 92]}}),
        ("undo", {}),
        ("redo", {}),
    )
    for path, body in acts:
        number = next(numbers)
        first, again = (sent(path, **body).json() for _ in range(2))
        assert first["act"] is not None
        assert again == first
        assert sent(path, "Bob", **body).json() == {"detail": "another person's act has this id"}
    there = labels(client)
    assert (len(there["tags"]), len(there["tracks"])) == (1, 1)
    number = next(numbers)
    first, again = (sent("act", act={"kind": "propose"}).json()["task"] for _ in range(2))
    assert first == again
    engine.wait_for(lambda shown: shown.labels.task is not None and not shown.labels.task.running, WAIT_S)
    number = next(numbers)
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 9}, "final": False})
    assert [sent("undo").json()["what"] for _ in range(2)] == ["the parameters being tried"] * 2


def test_what_was_meant_for_another_recording_is_not_done_to_this_one(client: httpx.Client) -> None:
    drive = labels(client)["drive"]["id"]
    tag = {"kind": "tag", "first": 3, "last": 3, "tag": "night"}
    assert client.post("/api/labels/act", json={"person": "Ada", "act": tag, "drive": drive}).status_code == 200
    before = labels(client)["revision"]
    for path, body in (("act", {"act": tag}), ("act", {"act": {"kind": "propose"}}), ("undo", {}), ("redo", {})):
        answer = client.post(f"/api/labels/{path}", json={"person": "Ada", "drive": "another"} | body)
        assert (answer.status_code, answer.json()["detail"]) == (409, "another recording is open now")
        assert client.post(f"/api/labels/{path}", json={"person": "Ada"} | body).status_code == 422, (
            "nobody knows which"
        )
    live = client.post("/api/labels/undo", json={"person": "Ada", "drive": None})
    assert live.status_code == 409, "of live sensors, which are not open"
    handed = client.post("/api/labels/import", params={"person": "Ada", "drive": "another"}, content=b"{}")
    assert (handed.status_code, handed.json()["detail"]) == (409, "another recording is open now")
    assert labels(client)["revision"] == before


def test_an_act_is_answered_from_the_recording_that_it_was_done_to(
    engine: Engine, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another recording is opened between the commit and the answer."""
    opened = engine.labels._open
    do = Log.act

    def act_and_close(self: Log, *args: Any, **more: Any) -> Any:
        done = do(self, *args, **more)
        engine.labels.open("another", None)
        return done

    monkeypatch.setattr(Log, "act", act_and_close)
    try:
        answer = act(client, kind="tag", first=3, last=3, tag="night")
    finally:
        engine.labels.open(opened.uri, opened.recording)
    assert (answer.status_code, len(answer.json()["changed"]["tags"])) == (200, 1)


def test_a_conflict_shows_both_and_loses_neither(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    mine = {"kind": "relabel", "track": track["id"], "revision": track["revision"], "label": "bus"}
    theirs = act(client, "Bob", **(mine | {"label": "truck"})).json()["changed"]["tracks"][0]
    refused = act(client, **mine)
    assert refused.status_code == 409
    assert refused.json()["detail"] == f"Bob changed #{track['id']} since"
    assert refused.json()["theirs"]["label"] == "truck"
    assert refused.json()["item"] == {"kind": "track", "id": mine["track"]}
    assert refused.json()["yours"] == mine
    assert act(client, **(mine | {"revision": theirs["revision"]})).status_code == 200
    history = client.get("/api/labels/history", params={"kind": "track", "id": track["id"]}).json()
    assert [entry["after"]["label"] for entry in history[:2]] == ["bus", "truck"]
    undo = move(client, "undo", "Bob")
    assert (undo.status_code, "Ada changed" in undo.json()["detail"]) == (409, True)


def test_two_servers_of_a_team_see_each_others_acts(postgres_url: str) -> None:
    with ExitStack() as stack:
        first, ada = stack.enter_context(team(Database(postgres_url)))
        second, bob = stack.enter_context(team(Database(postgres_url)))
        done = act(ada, kind="tag", first=3, last=3, tag="night").json()
        second.wait_for(lambda shown: shown.labels.revision == done["revision"], WAIT_S)
        (tag,) = labels(bob)["tags"]
        act(bob, "Bob", kind="remove", items=[{"kind": "tag", "id": tag["id"], "revision": tag["revision"]}])
        first.wait_for(lambda shown: shown.labels.revision == done["revision"] + 1, WAIT_S)
        assert labels(ada, since=done["revision"])["removed"] == [{"kind": "tag", "id": tag["id"]}]


def test_after_a_restart_everything_is_there_and_can_be_undone(tmp_path: Any) -> None:
    file = tmp_path / "labels.db"
    with team(Database.in_file(file)) as (_, client):
        act(client, kind="tag", first=3, last=3, tag="night")
        client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 5}, "person": "Ada"})
    with team(Database.in_file(file)) as (_, client):
        assert len(labels(client)["tags"]) == 1
        assert labels(client, person="Ada")["can_undo"]
        undone = [move(client, "undo", "Ada").json()["what"] for _ in range(2)]
        assert undone == ["cipv.confirm_hits 3 → 5", "tagged frame 4 night"]
        assert move(client, "undo", "Ada").status_code == 409
        assert labels(client)["tags"] == []


def test_a_database_that_fails_keeps_nobody_from_driving(
    engine: Engine, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(_: Database) -> None:
        raise DatabaseError("labels: the server is away")

    with monkeypatch.context() as patched:
        patched.setattr(Database, "writing", away)
        assert client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 6}}).status_code == 200
        assert engine.control.peek().params.cipv.confirm_hits == 6
        for refused in (
            act(client, kind="tag", first=1, last=1, tag="x"),
            move(client, "undo", "A"),
        ):
            assert (refused.status_code, refused.json()["detail"]) == (503, "labels: the server is away")
        patched.setattr(Database, "reading", away)
        assert client.get("/api/compare").status_code == 200
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 3}})
    assert act(client, kind="tag", first=1, last=1, tag="x").status_code == 200


def test_what_others_stand_behind_is_reviewed_one_by_one(client: httpx.Client) -> None:
    def following(person: str, frame: int = -1, **after: Any) -> tuple[int | None, Any, int]:
        query = {"what": "unreviewed", "frame": frame, "person": person, **after}
        found = client.get("/api/labels/next", params=query).json()
        return found["frame"], found["item"], found["left"]

    made = act(client, kind="add_track", label="car", frame=4, cuboid=CUBOID, bbox=None).json()
    (track,) = made["changed"]["tracks"]
    act(client, kind="set_lead", first=4, last=9, lead=track["id"])
    act(client, kind="add_event", frame=9, event="cut_in", tracks=[track["id"]])
    held = labels(client)
    car, lead, event = (
        {"kind": kind, "id": held[f"{kind}s"][0]["id"], "revision": held[f"{kind}s"][0]["revision"]}
        for kind in ("track", "lead", "event")
    )

    def key(item: dict[str, Any]) -> dict[str, Any]:
        return {"kind": item["kind"], "id": item["id"]}

    assert following("Ada") == (None, None, 0), "one's own work is for another"
    assert following("Bob") == (4, key(car), 3)
    after = {"after_kind": "track", "after_id": car["id"]}
    assert following("Bob", 4, **after) == (4, key(lead), 3), "the other label of that frame comes first"
    assert following("Bob", 4) == (9, key(event), 3)
    assert act(client, "Bob", kind="review_ok", items=[car, event]).is_success
    assert labels(client)["events"][0]["reviewer"] == "Bob"
    assert following("Bob") == (4, key(lead), 1)
    act(client, "Bob", kind="send_back", items=[lead], comment="it is another")
    assert following("Bob") == (None, None, 0)
    back = client.get("/api/labels/next", params={"what": "sent_back", "frame": 0}).json()
    assert (back["frame"], back["why"]) == (4, f"the lead #{track['id']}: it is another")
    assert following("Cy") == (None, None, 0), "what was reviewed once is reviewed"
    act(client, kind="relabel", track=track["id"], revision=labels(client)["tracks"][0]["revision"], label="truck")
    assert following("Cy") == (4, key(car), 1), "and when it is changed, to be reviewed again"


def test_recordings_are_assigned_and_whoever_labels_one_does_not_say_that_it_is_done(client: httpx.Client) -> None:
    act(client, kind="set_lead", first=0, last=4, lead="none")
    key = client.get("/api/labels").json()["drive"]["id"]

    def change(**body: object) -> httpx.Response:
        return client.post("/api/labels/queue", json={"person": "Ada", "drive": key, **body})

    assert change(assign="Ada").status_code == 200
    work = next(each for each in client.get("/api/labels/queue").json() if each["key"] == key)
    assert (work["person"], work["state"]) == ("Ada", "labeling")
    assert work["labelled"] > 0
    assert "Ada" in {each["person"] for each in work["efforts"]}
    refused = change(state="done")
    assert (refused.status_code, "a second person" in refused.json()["detail"]) == (409, True)
    left = change(state="done", person="Bob")
    assert (left.status_code, "not reviewed" in left.json()["detail"]) == (409, True)
    assert change(state="done", person="Bob", anyway=True).status_code == 200
    assert change(assign="", state="open").status_code == 200
    assert client.post("/api/labels/queue", json={"person": "Ada", "drive": "none"}).status_code == 404
