"""A second person goes through what others have labelled, by keys."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START
from tests.browser.labels.hands import LEAD_X, Hand, Labels, draw, is_at
from tests.browser.looks import COUNT, go_to

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

CAR = {"center": [LEAD_X, 0.0, 0.1], "size": [4.4, 1.8, 1.5], "yaw_rad": 0.0}


def test_labels_and_who_leads_are_found_right_or_sent_back_one_after_the_other(hand: Hand, labels: Labels):
    page = hand.page
    added = labels.act("Bob", {"kind": "add_track", "label": "car", "frame": START + 2, "cuboid": CAR, "bbox": None})
    made = added["changed"]["tracks"][0]["id"]
    labels.act("Bob", {"kind": "set_lead", "first": START + 2, "last": START + 6, "lead": made})
    under, said = page.locator(".reviewing .under"), page.locator(".said")

    hand.keys("Shift+R")
    expect(page.get_by_role("button", name="Review", exact=True)).to_have_attribute("aria-pressed", "true")
    expect(said).to_contain_text("2 to review")
    is_at(page, START + 2)
    expect(under).to_have_text(f"#{made} car")
    hand.keys("n")
    expect(under).to_have_text(f"lead #{made}, frames {START + 3}–{START + 7}")
    hand.keys("Shift+N")
    expect(under).to_have_text(f"#{made} car")
    hand.keys("a")
    labels.wait_for(lambda now: now.tracks[made]["reviewer"] == "Ada")
    expect(said).to_contain_text("1 to review")
    expect(under).to_have_text(f"lead #{made}, frames {START + 3}–{START + 7}")
    hand.keys("r")
    dialog = page.get_by_role("dialog", name="Send back")
    dialog.get_by_label("Comment").fill("it begins later")
    dialog.get_by_role("button", name="OK").click()
    expect(said).to_contain_text("No labels from others left to review")
    (lead,) = labels.everything["leads"]
    assert (lead["state"], lead["comment"], lead["reviewer"]) == ("proposed", "it begins later", "")
    expect(page.locator("#label-bar .where")).to_have_text(f"sent back {START + 3}–{START + 7}: it begins later")
    expect(under).to_have_text("nothing to review here")
    assert page.locator(".reviewing").get_by_role("button").all_inner_texts() == ["Find next"]
    hand.keys("a")
    expect(said).to_have_text("No label selected, and no lead to review in this frame")
    mark = page.locator(f".track-row[data-id='{made}'] .mark")
    expect(mark).to_have_text("✓✓")
    assert mark.evaluate("(node) => node.scrollWidth <= node.clientWidth"), "both ticks are seen"
    hand.keys("Shift+R")
    expect(page.locator(".reviewing")).to_be_hidden()


def test_with_nothing_left_no_lead_of_ones_own_is_offered(hand: Hand, labels: Labels):
    page, under = hand.page, hand.page.locator(".reviewing .under")
    labels.act("Ada", {"kind": "set_lead", "first": 0, "last": COUNT - 1, "lead": "none"})
    expect(page.locator("#label-bar .where")).to_contain_text("accepted")
    hand.keys("Shift+R")
    expect(page.locator(".said")).to_contain_text("No labels from others left to review")
    expect(under).to_have_text("nothing to review here")
    go_to(page, 0)
    is_at(page, 0)
    expect(under).to_have_text("nothing to review here")

    labels.act("Bob", {"kind": "set_lead", "first": 0, "last": 3, "lead": "unknown"})
    expect(under).to_have_text("lead unclear, frames 1–4")
    hand.keys("Shift+R")


def test_an_event_is_reviewed_and_says_by_whom(hand: Hand, labels: Labels):
    page = hand.page
    labels.act("Bob", {"kind": "add_event", "frame": START, "event": "cut_in", "tracks": []})
    page.get_by_role("tab", name="Frame").click()
    hand.keys("Shift+R")
    expect(page.locator(".reviewing .under")).to_have_text(f"cut-in in frame {START + 1}")
    page.get_by_role("button", name="Approve", exact=True).click()
    expect(page.locator(".moment-row")).to_contain_text("reviewed by Ada")
    hand.keys("Escape")
    expect(page.locator(".reviewing")).to_be_hidden()


def test_what_another_left_of_ones_own_lead_is_reviewed_by_that_person(hand: Hand, labels: Labels):
    page, under = hand.page, hand.page.locator(".reviewing .under")
    approve = page.get_by_role("button", name="Approve", exact=True)
    labels.act("Bob", {"kind": "set_lead", "first": START, "last": START + 6, "lead": "none"})
    labels.act("Ada", {"kind": "set_lead", "first": START + 3, "last": START + 3, "lead": "unknown"})
    hand.keys("Shift+R")
    expect(under).to_have_text(f"lead none, frames {START + 1}–{START + 3}")
    approve.click()
    expect(under).to_have_text(f"lead none, frames {START + 5}–{START + 7}")
    approve.click()
    expect(page.locator(".said")).to_contain_text("No labels from others left to review")
    reviewers = {each["first"]: each["reviewer"] for each in labels.everything["leads"]}
    assert reviewers == {START: "Ada", START + 3: "", START + 4: "Ada"}
    hand.keys("Shift+R")


def test_ones_own_track_cannot_be_approved_and_the_button_says_why(hand: Hand, labels: Labels):
    page, approve = hand.page, hand.page.get_by_role("button", name="Approve", exact=True)
    made = draw(hand, labels)
    hand.keys("Shift+R")
    page.locator(f".track-row[data-id='{made}']").click()
    expect(page.locator(".reviewing .under")).to_have_text(f"#{made} car")
    expect(approve).to_be_disabled()
    expect(approve).to_have_attribute("title", "Your own label: a second person must review it")
    hand.keys("a")
    expect(page.locator(".said")).to_have_text("Your own label: a second person must review it")
    expect(page.locator(".reviewing").get_by_role("button", name="Send back", exact=True)).to_be_enabled()
    hand.keys("Escape", "Shift+R")
