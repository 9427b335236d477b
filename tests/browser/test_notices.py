"""Notices: what frames say comes and goes, and may neither move the page nor fill it."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.looks import show_instead, wait_for_frame, whole_drive

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

INFO = {"level": "info", "text": "Lane lines by a network"}
SILENT = {"level": "warning", "text": "Waiting for sensors: lidar silent, camera silent, gnss silent, ego silent"}
MANY = ["lidar stale", "the far view was left out", "Camera or LiDAR has turned: yaw +0.1°, pitch +2.3°"]


def say(page: Page, notes: list[str], *notices: dict[str, str]) -> Any:
    """Show these notes of the frame and notices of the server; the top of what lies below."""
    show_instead(page, frame={"result": {"notes": notes}}, state={"notices": list(notices)})
    return page.evaluate("document.querySelector('#workspace').getBoundingClientRect().top")


def settled(open_page: OpenPage, site: Site) -> Page:
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    return page


def test_notes_of_frames_do_not_move_the_page(open_page: OpenPage, site: Site) -> None:
    page = settled(open_page, site)
    assert len({say(page, notes, INFO) for notes in ([], ["lane disagrees"], MANY, [])}) == 1
    page.locator("#notices").get_by_role("button", name="Dismiss").click()
    first = say(page, ["lane disagrees"])
    assert say(page, []) == first, "the row stays, now that frames have notes"
    expect(page.locator("#notices")).to_have_text("no notes on this frame✕")
    page.locator("#notices").get_by_role("button", name="Dismiss").click()
    assert say(page, []) < first


def test_a_refused_undo_is_told_outside_labeling(open_page: OpenPage) -> None:
    page = open_page(expects=("status of 409",))
    wait_for_frame(page, START)
    nothing = "there is nothing to undo"  # whatever other tests changed before
    page.route("**/api/labels/undo", lambda route: route.fulfill(status=409, json={"detail": nothing}), times=1)
    page.keyboard.press("Control+z")
    expect(page.locator("#notices")).to_contain_text(nothing)


def test_many_notices_take_one_line_and_can_all_be_read(open_page: OpenPage, site: Site) -> None:
    page = settled(open_page, site)
    one = say(page, [], INFO)
    assert say(page, MANY, INFO, SILENT) == one
    notices = page.locator("#notices")
    expect(notices).to_have_text(f"warning{SILENT['text']}+4 more✕")
    notices.get_by_role("button", name="+4 more").click()
    for words in (*MANY, INFO["text"], SILENT["text"]):
        expect(notices.get_by_text(words)).to_be_visible()
    notices.get_by_role("button", name="Show less").click()
    expect(notices.locator(".notice")).to_have_count(1)
    say(page, [], {"level": "info", "text": "a single notice that is longer than the page is wide, " * 9})
    words = notices.locator(".one-line > span")
    notices.get_by_role("button", name="Show all").click()
    assert words.evaluate("(node) => node.scrollWidth <= node.clientWidth && node.clientHeight > 30")
    notices.get_by_role("button", name="Show less").click()
    assert words.evaluate("(node) => node.scrollWidth > node.clientWidth && node.clientHeight < 30")
    say(page, [], INFO)
    expect(notices.get_by_role("button", name="Show")).to_have_count(0)


def test_a_note_that_was_dismissed_stays_away_with_other_numbers(open_page: OpenPage, site: Site) -> None:
    page = settled(open_page, site)
    say(page, ["lane disagrees with the rest by 4 sigmas: ignored"])
    notices = page.locator("#notices")
    notices.get_by_role("button", name="Dismiss").click()
    say(page, ["lane disagrees with the rest by 5.5 sigmas: ignored"])
    expect(notices).not_to_contain_text("disagrees")
    say(page, ["gnss stale"])
    expect(notices).to_contain_text("gnss stale")


def follow(page: Page, made_unix_ms: int) -> None:
    """The shown frame as if it came from live sensors and was made at this time."""
    live = {"live": True, "playing": True}
    show_instead(page, frame={"madeUnixMs": made_unix_ms, "result": {"notes": []}}, state=live)


def test_live_data_that_stops_coming_looks_old(open_page: OpenPage, site: Site) -> None:
    page = settled(open_page, site)
    follow(page, 1)
    assert page.evaluate("getComputedStyle(document.querySelector('#banner')).filter") == "none"
    error = page.locator(".notice[data-level=error]")
    expect(error).to_contain_text("No new data for")
    assert "saturate" in page.evaluate("getComputedStyle(document.querySelector('#banner')).filter")
    follow(page, 2)
    expect(error).to_have_count(0)
    assert page.evaluate("getComputedStyle(document.querySelector('#banner')).filter") == "none"
