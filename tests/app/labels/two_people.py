"""Two people who label one recording at random at the same time, each by what that person's page shows, and what must
hold in the end: both see the same, and whoever lost something to the other was told.

As the page does, each keeps the labels that it has heard of, sends acts with the revisions that it saw, is told of a
conflict by the answer 409, and hears of the other's acts by asking for what changed."""

from __future__ import annotations

import random
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import httpx

from tests.app.labels.site import COUNT, CUBOID
from tests.app.web.serving import WAIT_S

_LISTS = {"track": "tracks", "lead": "leads", "path": "paths", "event": "events", "tag": "tags"}
_REFRESH = 0.15
"""Share of the acts that use the current state; the others use a state that is some acts old."""


@dataclass
class Hand:
    """One person at one page."""

    name: str
    address: str
    seed: int
    known: dict[tuple[str, int], dict[str, Any]] = field(default_factory=dict)
    """The items that the page shows, by kind and id."""
    seen: int = 0
    """The revision of these items."""
    done: list[tuple[int, int, dict[str, Any]]] = field(default_factory=list)
    """(act, revision seen, body) of each completed act."""
    told: Counter[str] = field(default_factory=Counter)
    """Number of answers of each kind."""

    def work(self, count: int) -> None:
        """Do this number of random acts."""
        rng = random.Random(self.seed)
        with httpx.Client(base_url=self.address, timeout=WAIT_S) as client:
            drive = client.get("/api/labels").json()["drive"]["id"]
            self.look(client)
            for _ in range(count):
                if rng.random() < _REFRESH:
                    self.look(client)
                self._act(client, drive, rng)
            self.look(client)

    def look(self, client: httpx.Client) -> None:
        """Fetch the changes since the last call."""
        answer = client.get("/api/labels", params={"since": self.seen}).json()
        for gone in answer["removed"]:
            self.known.pop((gone["kind"], gone["id"]), None)
        for kind, name in _LISTS.items():
            for each in answer[name]:
                self.known[kind, each["id"]] = each
        self.seen = answer["revision"]

    def _act(self, client: httpx.Client, drive: str, rng: random.Random) -> None:
        undo = rng.random() < 0.1
        body = {} if undo else self._body(rng)
        path = "undo" if undo else "act"
        sent = {"person": self.name, "drive": drive} | ({} if undo else {"act": body})
        answer = client.post(f"/api/labels/{path}", json=sent)
        assert answer.status_code in (200, 404, 409), answer.text
        said = answer.json()
        if answer.status_code == 200:
            self.told["done" if said["act"] is not None else "nothing changed"] += 1
            if said["act"] is not None:
                self.done.append((said["act"], self.seen, {"kind": "undo"} if undo else body))
            return
        assert said["detail"], "whoever is refused is told why"
        if "item" in said:
            assert said["yours"] == _normal(body, said["yours"]), "both versions are shown"
            self.told["conflict"] += 1
        else:
            self.told["refused"] += 1
        if rng.random() < 0.5:
            self.look(client)

    def _body(self, rng: random.Random) -> dict[str, Any]:
        tracks = [each for (kind, _), each in self.known.items() if kind == "track"]
        first = rng.randrange(COUNT)
        last = min(first + rng.randrange(6), COUNT - 1)
        over = {"first": first, "last": last, "seen": self.seen}
        at = {"frame": first, "seen": self.seen}
        cuboid = CUBOID | {"center": [10.0 + 30 * rng.random(), 6 * rng.random() - 3, 0.5]}
        frames = [
            {"kind": "set_lead", "lead": rng.choice(["none", "unknown"]), **over},
            {"kind": "clear_lead", **over},
            {"kind": "tag", "tag": rng.choice(["night", "rain"]), "on": rng.random() < 0.7, **over},
            {
                "kind": "set_path",
                "frame": first,
                "left": [[0, 1], [9, 1 + rng.random()]],
                "right": None,
                "seen": self.seen,
            },
            {"kind": "add_event", "event": "cut_in", "tracks": [], **at},
        ]
        if len(tracks) < 4 or (len(tracks) < 12 and rng.random() < 0.1):
            return {"kind": "add_track", "label": "car", "frame": first, "cuboid": cuboid, "bbox": None}
        if rng.random() < 0.35:
            return rng.choice(frames)
        track = rng.choice(tracks)
        mine = {"track": track["id"], "revision": track["revision"]}
        items = {"items": [{"kind": "track", "id": track["id"], "revision": track["revision"]}]}
        return rng.choice(
            [
                {"kind": "set_sighting", "frame": first, "cuboid": cuboid, "bbox": None, **mine},
                {"kind": "set_sighting", "frame": first, "cuboid": cuboid, "bbox": None, **mine},
                {"kind": "relabel", "label": rng.choice(["car", "van", "truck", "bus"]), **mine},
                {"kind": "set_attribute", "name": "motion", "value": "parked", "first": first, "last": last, **mine},
                {"kind": "flip", **mine},
                {"kind": "split", "frame": first, **mine},
                {"kind": "set_lead", "lead": track["id"], **over},
                {"kind": rng.choice(["accept", "reject", "remove", "review_ok"]), **items},
                {"kind": "send_back", "comment": "look again", **items},
                {"kind": "drop_sightings", "first": first, "last": last, **mine},
            ]
        )


def _normal(body: dict[str, Any], yours: dict[str, Any]) -> dict[str, Any]:
    """The request with the values that the server fills in."""
    return yours if all(yours.get(key) is not None or value is None for key, value in body.items()) else body


def at_once(hands: Sequence[Hand], count: int) -> None:
    """Run all of them, each in its own thread; an exception in one is raised again."""
    raised: list[BaseException] = []

    def work(hand: Hand) -> None:
        try:
            hand.work(count)
        except BaseException as error:
            raised.append(error)

    threads = [threading.Thread(target=work, args=(hand,), name=hand.name) for hand in hands]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if raised:
        raise raised[0]


def label_together(addresses: tuple[str, str], count: int) -> dict[str, Counter[str]]:
    """Let two people, each with one of these addresses, do this number of acts at once, and check the end. Returns what
    each of them was told."""
    hands = [Hand("Ada", addresses[0], 1), Hand("Bob", addresses[1], 2)]
    at_once(hands, count)
    check_the_end(hands)
    told = hands[0].told + hands[1].told
    assert told["done"] > count, "most of what they do is done"
    assert told["conflict"], "they get in each other's way, and are told"
    return {hand.name: hand.told for hand in hands}


def check_the_end(hands: Sequence[Hand]) -> None:
    """Both pages show the content of the database; every confirmed act is in the log exactly once; and nobody changed a
    track without having seen the other's last change."""
    everything = []
    for hand in hands:
        with httpx.Client(base_url=hand.address, timeout=WAIT_S) as client:
            hand.look(client)
            whole = client.get("/api/labels").json()
            fresh = {(kind, each["id"]): each for kind, name in _LISTS.items() for each in whole[name]}
            assert hand.known == fresh, f"{hand.name}'s page shows something else than there is"
            frames = client.get("/api/labels/frames", params={"first": 0, "last": COUNT - 1}).json()["sightings"]
            everything.append((fresh, frames))
    assert all(each == everything[0] for each in everything), "both see the same"

    numbers = [act for hand in hands for act, _, _ in hand.done]
    assert len(set(numbers)) == len(numbers), "no two acts are one"
    by_act = {act: (hand.name, seen, body) for hand in hands for act, seen, body in hand.done}
    with httpx.Client(base_url=hands[0].address, timeout=WAIT_S) as client:
        tracks = {body["track"] for _, _, body in by_act.values() if "track" in body}
        for number in sorted(tracks):
            past = client.get("/api/labels/history", params={"kind": "track", "id": number}).json()
            for each in past:
                if each["act"] in by_act:
                    assert by_act[each["act"]][0] == each["person"]
                _check_seen(each, past, by_act)


def _check_seen(each: dict[str, Any], past: list[dict[str, Any]], by_act: dict[int, tuple[str, int, Any]]) -> None:
    """Before an act on a track, its person had seen the other's last change to it."""
    name, _, body = by_act.get(each["act"], ("", 0, {}))
    if "track" not in body:
        return
    others = [one["act"] for one in past if one["act"] < each["act"] and one["person"] != each["person"]]
    assert not others or max(others) <= body["revision"], (name, body, others)
