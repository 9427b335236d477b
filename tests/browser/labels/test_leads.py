"""Who leads, and where that begins and ends: painted, dragged and moved by keys."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.labels.hands import LEADS_Y, Hand, Labels, is_at
from tests.browser.looks import box_of, go_to, on_timeline, pixels, repainted

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def border(hand: Hand, frame: int) -> tuple[float, float]:
    """Pixel of the border before a frame, in the leads' row."""
    front = box_of(hand.page.locator("#timeline-front"))
    middles = on_timeline(hand.page, frame - 1), on_timeline(hand.page, frame)
    return front["x"] + sum(middles) / 2, front["y"] + LEADS_Y


def test_ends_of_a_range_are_dragged_and_the_neighbour_gives_way(hand: Hand, labels: Labels):
    page = hand.page
    for first, last, lead in ((40, 79, "none"), (80, 120, "unknown")):
        labels.act("Ada", {"kind": "set_lead", "first": first, "last": last, "lead": lead})
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_text("none")
    for start, end, then in (
        (80, 100, [(40, 99, "none"), (100, 120, "unknown")]),  # a shared end, right: the left one grows
        (100, 70, [(40, 69, "none"), (70, 120, "unknown")]),  # left: the right one does
        (121, 110, [(40, 69, "none"), (70, 109, "unknown")]),  # a free end: nobody says who leads there
        (40, 30, [(30, 69, "none"), (70, 109, "unknown")]),
    ):
        hand.drag(border(hand, start), border(hand, end), steps=6)
        labels.wait_for(lambda now, then=then: now.leads == then)
    is_at(page, 30)
    hand.keys("Control+z")
    labels.wait_for(lambda now: now.leads == [(40, 69, "none"), (70, 109, "unknown")])


def test_a_dragged_end_is_seen_on_the_way_and_escape_lets_go_of_it(hand: Hand, labels: Labels):
    page = hand.page
    labels.act("Ada", {"kind": "set_lead", "first": 40, "last": 79, "lead": "none"})
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_text("none")
    page.mouse.move(*border(hand, 80))
    expect(page.locator("#timeline-front")).to_have_css("cursor", "ew-resize")
    page.mouse.down()
    page.mouse.move(*border(hand, 110), steps=6)
    is_at(page, 109)
    held = pixels(page, "#timeline-front")
    page.keyboard.press("Escape")
    assert repainted(page, "#timeline-front", held)
    page.mouse.move(*border(hand, 130), steps=3)
    page.mouse.up()
    hand.drag(border(hand, 40), border(hand, 50), steps=3)  # the next one is a drag of its own
    labels.wait_for(lambda now: now.leads == [(50, 79, "none")])
    is_at(page, 50)


def test_ends_come_to_the_shown_frame_by_keys(hand: Hand, labels: Labels):
    page = hand.page
    hand.keys("]")
    expect(page.locator(".said")).to_contain_text("No lead ranges yet")
    for first, last, lead in ((40, 79, "none"), (80, 120, "unknown")):
        labels.act("Ada", {"kind": "set_lead", "first": first, "last": last, "lead": lead})
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_text("none")
    for frame, key, then in (
        (74, "[", [(40, 73, "none"), (74, 120, "unknown")]),
        (90, "]", [(40, 90, "none"), (91, 120, "unknown")]),
        (130, "]", [(40, 90, "none"), (91, 130, "unknown")]),
        (35, "[", [(35, 90, "none"), (91, 130, "unknown")]),
    ):
        go_to(page, frame)
        is_at(page, frame)
        hand.keys(key)
        labels.wait_for(lambda now, then=then: now.leads == then)
