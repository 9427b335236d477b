"""Who leads, labelled through the browser in every frame of two real drives, with the acts that it took. The hand on
mouse and keys knows the truth. Written to ``build/label_leads.json``."""

from __future__ import annotations

import json
import math
from itertools import groupby

import pytest
from playwright.sync_api import expect

from pipeline.common.geometry import Cuboid
from pipeline.labels.model import FARTHEST_LEAD_M
from pipeline.sources import open_source
from tests.browser.conftest import Pages, Site, browser, opening, pages  # noqa: F401
from tests.browser.labels.hands import Labels, begin, is_at, is_saved
from tests.soak.label_quality import by_frame, truth_of, vehicles
from tests.soak.test_label_wholly import BUILD, SAME_PLACE_M, Person, desk  # noqa: F401

pytestmark = pytest.mark.soak

HALF_PATH_M = 1.5
"""A vehicle this close to the axis is in the path: both drives are nearly straight."""
NOBODY = {"0009"}
"""Drives in which nothing in the path is nearer than 60 m (README of the data): parked cars are near the axis."""


def true_leads(name: str, site: Site, count: int) -> dict[int, Cuboid | None]:
    """The nearest vehicle in the path, by frame."""
    there = by_frame(
        vehicles(truth_of(name, open_source(site.engine.snapshot.uri))),
        lambda cuboid: 0 < cuboid.center[0] < FARTHEST_LEAD_M and abs(cuboid.center[1]) < HALF_PATH_M,
    )
    if name in NOBODY:
        return dict.fromkeys(range(count))
    return {
        frame: min((cuboid for _, cuboid in there.get(frame, ())), key=lambda each: each.center[0], default=None)
        for frame in range(count)
    }


def wanted_leads(person: Person, true: dict[int, Cuboid | None]) -> dict[int, int | str]:
    """The proposed track on the true lead, by frame; "none" without a lead, "missed" where it is not proposed."""
    proposed = person.cuboids(("proposed",))
    found: dict[int, int | str] = {}
    for frame, cuboid in true.items():
        if cuboid is None:
            found[frame] = "none"
            continue
        near = [
            (math.dist(there[frame].center[:2], cuboid.center[:2]), number)
            for number, there in proposed.items()
            if frame in there
        ]
        away_m, number = min(near, default=(math.inf, -1))
        found[frame] = number if away_m < SAME_PLACE_M else "missed"
    return found


def set_leads(person: Person, wanted: dict[int, int | str]) -> None:
    """Correct the proposed leads that are wrong, then accept what is left."""
    hand, labels = person.hand, person.labels

    def held() -> dict[int, int | str]:
        return {frame: lead for first, last, lead in labels.leads for frame in range(first, last + 1)}

    proposed = held()
    wrong = [frame for frame in wanted if wanted[frame] != proposed.get(frame)]
    for lead, run in groupby(wrong, key=lambda frame: (wanted[frame], frame - wrong.index(frame))):
        frames = list(run)
        person.go_to(frames[0])
        hand.keys("i")
        if len(frames) > 1:
            person.go_to(frames[-1])
        hand.keys("o", *("0" if lead[0] == "none" else str(lead[0])), "Enter")
        labels.wait_for(lambda _, frames=frames: all(held().get(frame) == wanted[frame] for frame in frames))
        person.note("corrected")
    for each in labels.everything["leads"]:
        if each["state"] != "proposed":
            continue
        shown = int(person.page.locator("#label-bar").get_attribute("data-frame") or -1)
        if not each["first"] <= shown <= each["last"]:
            person.go_to(each["first"])
        hand.keys("a")
        labels.wait_for(
            lambda now, at=each["id"]: next(r for r in now.everything["leads"] if r["id"] == at)["state"] == "accepted"
        )
        person.note("accepted")
        if isinstance(each["lead"], int):
            expect(person.page.locator(".track-row[aria-selected=true]")).to_have_attribute(
                "data-id", str(each["lead"])
            )


def test_who_leads_is_labelled_with_few_acts(desk: tuple[str, Site], pages: Pages) -> None:  # noqa: F811
    name, site = desk
    with opening(pages, site) as open_page:
        page = open_page(1440, 900)
        labels = Labels(page, site.address)
        count = labels.get("")["drive"]["count"]
        person = Person(begin(page), labels, count, {})
        page.set_default_timeout(60_000)
        is_at(page, 0)
        person.hand.keys("p")
        labels.wait_for(lambda now: len(now.leads) > 0)
        is_saved(page)
        wanted = wanted_leads(person, true_leads(name, site, count))
        assert "missed" not in wanted.values(), "each true lead is proposed"
        set_leads(person, wanted)
        for track in sorted({each for each in wanted.values() if isinstance(each, int)}):
            row = page.locator(f".track-row[data-id='{track}']")
            if row.get_attribute("aria-selected") != "true":
                person.select(track)
            person.key(track, "a")
        got = {frame: lead for first, last, lead in labels.leads for frame in range(first, last + 1)}
        hands = sum(person.hand.counts[each] for each in ("keys", "presses", "drags"))
        found = {"frames": count, "hands": hands, "hands_per_frame": round(hands / count, 2), "done": person.seen}
        BUILD.mkdir(exist_ok=True)
        file = BUILD / "label_leads.json"
        known = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
        file.write_text(json.dumps(known | {name: found}, indent=2) + "\n", encoding="utf-8")
        print(name, found)
    assert got == wanted
    assert {item.value.state for item in site.engine.labels.labels.items("lead").values()} <= {"accepted", "corrected"}
    assert found["hands_per_frame"] <= 0.3
