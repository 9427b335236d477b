"""Two people label one recording independently, one after the other, and the page shows how they agree."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.labels.hands import LEAD_X, LEAD_Y, Hand, Labels, draw, is_at, is_saved

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_a_second_person_starts_without_labels_and_both_are_compared(hand: Hand, labels: Labels) -> None:
    page = hand.page
    first = draw(hand, labels)
    labels.act("Ada", {"kind": "set_lead", "first": 60, "last": 63, "lead": first})
    is_saved(page)
    page.get_by_role("tab", name="Files").click()
    page.get_by_role("button", name="Freeze and start without labels").click()
    page.get_by_label("Version name").last.fill("by Ada")
    page.get_by_role("button", name="OK", exact=True).click()
    expect(page.locator(".agreement")).to_contain_text("Frozen as by Ada")
    labels.wait_for(lambda now: not now.tracks and not now.leads)

    page.get_by_role("tab", name="Tracks").click()
    hand.keys("g")
    hand.drag(hand.plan(LEAD_X - 1.7, LEAD_Y), hand.plan(LEAD_X + 2.2, LEAD_Y))
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (second,) = labels.tracks
    labels.act("Bob", {"kind": "set_lead", "first": 60, "last": 61, "lead": "none"})

    page.get_by_role("tab", name="Files").click()
    page.get_by_label("First version").select_option("by Ada")
    page.get_by_role("button", name="Compare").click()
    shown = page.locator(".agreement")
    expect(shown).to_contain_text("Cuboids: 1 in both")
    expect(shown).to_contain_text("same class in 100 %")
    expect(shown).to_contain_text("Lead: same in 0 % of 2 frames; different in:")
    shown.get_by_role("button", name="62", exact=True).click()
    is_at(page, 61)

    labels.act("Bob", {"kind": "set_lead", "first": 60, "last": 60, "lead": second})
    page.get_by_role("button", name="Compare").click()
    expect(shown).to_contain_text("Lead: same in 50 % of 2 frames")
