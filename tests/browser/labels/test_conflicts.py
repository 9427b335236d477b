"""What two people say of the same label is shown with both images, in metres and degrees, and in its frame."""

from __future__ import annotations

import math

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import START
from tests.browser.labels.conftest import Line
from tests.browser.labels.hands import Hand, Labels, draw, is_at, is_saved

pytestmark = pytest.mark.usefixtures("paused_in_traffic")
FROM_ABOVE, IN_IMAGE = "canvas[aria-label='from above']", "canvas[aria-label='in the image']"


def dialog_of(page: Page) -> Locator:
    return page.get_by_role("dialog", name="Two people changed the same label")


def change(labels: Labels, made: int, **act: object) -> None:
    """Bob changes a track."""
    labels.act("Bob", {"track": made, "revision": labels.tracks[made]["revision"], **act})


def test_a_shape_is_shown_in_its_frame_though_the_page_went_on(hand: Hand, labels: Labels, line: Line) -> None:
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    line.full = True
    hand.keys("ArrowUp")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    hand.keys("End")
    expect(page.locator("#label-bar")).not_to_have_attribute("data-frame", str(START))
    line.deaf = True
    theirs = {**labels.cuboid(made, START), "yaw_rad": 0.1}
    change(labels, made, kind="set_sighting", frame=START, cuboid=theirs)
    line.full = False
    page.get_by_role("button", name="Retry").click()
    dialog = dialog_of(page)
    expect(dialog).to_contain_text("yaw 5.7°")
    is_at(page, START)
    expect(dialog.locator(FROM_ABOVE)).to_have_count(2)
    expect(dialog.locator(IN_IMAGE)).to_have_count(2)
    expect(dialog, "nothing but what people say").not_to_contain_text("box")
    expect(dialog).not_to_contain_text("attributes")
    line.deaf = False
    dialog.get_by_role("button", name="Use theirs").click()
    is_saved(page)
    assert labels.cuboid(made, START)["yaw_rad"] == pytest.approx(0.1)

    line.deaf = True
    change(labels, made, kind="relabel", label="bus")
    hand.keys("Shift+X")
    expect(dialog).to_contain_text("Yours: reverse")
    expect(dialog.locator(FROM_ABOVE), "where it stands, and the other way round").to_have_count(2)
    line.deaf = False
    dialog.get_by_role("button", name="Use theirs").click()
    is_saved(page)


def test_who_keeps_theirs_is_not_asked_again_for_what_came_after_it(hand: Hand, labels: Labels, line: Line) -> None:
    """Nor does the page keep showing it once somebody else has changed the label again."""
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    was = labels.cuboid(made, START)
    line.full = line.deaf = True
    hand.keys("q")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    hand.keys("q", "t")
    change(labels, made, kind="set_sighting", frame=START, cuboid={**was, "yaw_rad": 0.3})
    line.full = False
    page.get_by_role("button", name="Retry").click()
    dialog = dialog_of(page)
    line.deaf = False
    dialog.get_by_role("button", name="Keep mine").click()
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")
    expect(dialog).to_be_hidden()
    assert labels.cuboid(made, START)["yaw_rad"] == pytest.approx(was["yaw_rad"] + math.radians(2))

    is_saved(page)
    change(labels, made, kind="set_sighting", frame=START, cuboid={**was, "yaw_rad": 0.35})
    expect(page.get_by_label("Heading, degrees to the left")).to_have_value("20.05")


def test_a_shape_of_a_track_that_was_removed_is_not_lost(hand: Hand, labels: Labels, line: Line) -> None:
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    was = labels.cuboid(made, START)
    line.deaf = True
    items = [{"kind": "track", "id": made, "revision": labels.tracks[made]["revision"]}]
    labels.act("Bob", {"kind": "remove", "items": items})
    hand.keys("ArrowUp")
    dialog = dialog_of(page)
    expect(dialog).to_contain_text(f"Bob removed #{made} since")
    expect(dialog).to_contain_text("Theirs: removed")
    line.deaf = False
    dialog.get_by_role("button", name="Keep mine").click()
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (again,) = labels.tracks
    assert again != made
    assert labels.cuboid(again, START)["center"][0] == pytest.approx(was["center"][0] + 0.1)


def test_two_paths_of_a_frame_are_drawn_and_said_in_metres(hand: Hand, labels: Labels, line: Line) -> None:
    page = hand.page
    line.deaf = True
    left, right, seen = [[0, 2], [40, 4]], [[0, -2], [40, 0]], labels.everything["revision"]
    labels.act("Bob", {"kind": "set_path", "frame": START, "left": left, "right": right, "seen": seen})
    hand.keys("Shift+P", "ArrowLeft", "Enter")
    dialog = dialog_of(page)
    expect(dialog).to_contain_text("2.25 m at 5 m · 3.00 m at 20 m · 4.00 m at 40 m")
    expect(dialog.locator(FROM_ABOVE)).to_have_count(2)
    line.deaf = False
    dialog.get_by_role("button", name="Use theirs").click()
    is_saved(page)
    assert labels.everything["paths"][0]["left"] == left
    hand.keys("Escape")
