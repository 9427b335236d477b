"""Rows of the track list stay where they are while the pointer is over the list, whatever changes the list."""

from __future__ import annotations

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import START
from tests.browser.labels.hands import Hand, Labels
from tests.browser.looks import box_of

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def sent_back(labels: Labels, count: int) -> list[int]:
    """Tracks that the list *To do* contains, in its order."""
    for at in range(count):
        shape = {"center": [20.0 + 8 * at, 3.0, 0.7], "size": [4.2, 1.8, 1.5], "yaw_rad": 0.0}
        labels.act("Bob", {"kind": "add_track", "frame": START, "label": "car", "cuboid": shape})
    for each in labels.tracks.values():
        ref = {"kind": "track", "id": each["id"], "revision": each["revision"]}
        labels.act("Ada", {"kind": "send_back", "items": [ref], "comment": "look again"})
    return sorted(labels.tracks)


def hover(page: Page, row: Locator) -> None:
    box = box_of(row)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def press_here(page: Page) -> None:
    page.mouse.down()
    page.mouse.up()


def judged(labels: Labels, kind: str, number: int, **more: str) -> None:
    ref = {"kind": "track", "id": number, "revision": labels.tracks[number]["revision"]}
    labels.act("Bob" if kind == "accept" else "Ada", {"kind": kind, "items": [ref], **more})


def test_a_press_hits_the_row_it_was_aimed_at_though_rows_above_it_have_left_the_list(hand: Hand, labels: Labels):
    page = hand.page
    first, second, third = sent_back(labels, 3)
    rows = page.locator(".track-row")
    page.get_by_role("button", name="To do", exact=True).click()
    expect(rows).to_have_count(3)
    hover(page, rows.nth(1))
    judged(labels, "accept", first)
    gone = page.locator(f".track-row.is-gone[data-id='{first}']")
    expect(gone.locator(".mark")).to_have_attribute("aria-label", "accepted")
    press_here(page)
    expect(page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(second))
    hand.keys("a")  # the next one is selected, and the pointer is still over this one
    labels.wait_for(lambda now: now.tracks[second]["state"] == "accepted")
    expect(page.locator(f".track-row.is-gone[data-id='{second}']")).to_be_visible()
    expect(page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(third))
    page.mouse.move(2, 2)
    expect(rows).to_have_count(1)
    expect(rows).to_have_attribute("data-id", str(third))


def test_a_label_that_joins_the_list_moves_no_row_under_the_pointer(hand: Hand, labels: Labels):
    page = hand.page
    first, second, third = sent_back(labels, 3)
    judged(labels, "accept", first)
    rows = page.locator(".track-row")
    page.get_by_role("button", name="To do", exact=True).click()
    expect(rows).to_have_count(2)
    hover(page, rows.first)
    judged(labels, "send_back", first, comment="look again")
    expect(rows).to_have_count(3)
    press_here(page)
    expect(page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(second))
    assert [row.get_attribute("data-id") for row in rows.all()] == [str(each) for each in (second, third, first)]
    page.mouse.move(2, 2)
    expect(rows.first).to_have_attribute("data-id", str(first))
