"""The list of what to do: tracks are accepted and rejected one after the other, by keys alone."""

from __future__ import annotations

from playwright.sync_api import expect

from tests.browser.conftest import START
from tests.browser.labels.hands import Hand, Labels


def test_what_is_accepted_or_rejected_in_the_list_selects_the_next_one(hand: Hand, labels: Labels) -> None:
    page = hand.page
    for at in range(3):
        shape = {"center": [20.0 + 8 * at, 3.0, 0.7], "size": [4.2, 1.8, 1.5], "yaw_rad": 0.0}
        labels.act("Bob", {"kind": "add_track", "frame": START + at, "label": "car", "cuboid": shape})
    numbers = sorted(labels.tracks)
    for each in labels.tracks.values():
        ref = {"kind": "track", "id": each["id"], "revision": each["revision"]}
        labels.act("Ada", {"kind": "send_back", "items": [ref], "comment": "look again"})
    rows = page.locator(".track-row")
    chosen = page.locator(".track-row[aria-selected=true]")
    page.get_by_role("button", name="To do", exact=True).click()
    expect(rows).to_have_count(3)
    rows.first.click()
    hand.keys("a")
    expect(chosen).to_have_attribute("data-id", str(numbers[1]))
    expect(page.locator("#label-bar")).to_have_attribute("data-frame", str(START + 1))
    hand.keys("r")
    expect(chosen).to_have_attribute("data-id", str(numbers[2]))
    labels.wait_for(lambda now: [now.tracks[n]["state"] for n in numbers] == ["accepted", "rejected", "proposed"])
    page.get_by_role("button", name="Here", exact=True).click()
    hand.keys("a")
    labels.wait_for(lambda now: now.tracks[numbers[2]]["state"] == "accepted")
    expect(chosen).to_have_attribute("data-id", str(numbers[2]))
    assert hand.counts["keys"] == 3
