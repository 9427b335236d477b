"""A drive labelled from one end to the other, by keys and by hand."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from pipeline.params import Params
from tests.browser.conftest import START, Site
from tests.browser.labels.hands import LEADS_Y, Hand, Labels, draw, is_at, is_saved
from tests.browser.looks import box_of, go_to, on_timeline, pixels, repainted, whole_drive

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_everything_is_done_by_keys_and_taken_back(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    start = labels.cuboid(made, START)
    for keys, dx, dy, deg in (
        (("ArrowUp", "ArrowUp", "ArrowLeft"), 0.2, 0.1, 0),
        (("Shift+ArrowDown", "Shift+ArrowRight"), -0.8, -0.9, 0),
        (("q", "Shift+Q", "e"), -0.8, -0.9, 10),
    ):
        hand.keys(*keys)
        labels.wait_for(
            lambda now, dx=dx, dy=dy, deg=deg: (
                now.cuboid(made, START)["center"][:2]
                == pytest.approx((start["center"][0] + dx, start["center"][1] + dy), abs=1e-6)
                and now.cuboid(made, START)["yaw_rad"] == pytest.approx(start["yaw_rad"] + math.radians(deg), abs=1e-6)
            )
        )
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")
    hand.keys("f", "f", "f")
    is_at(page, START + 3)
    hand.keys("k")
    labels.wait_for(lambda now: now.tracks[made]["keyframes"] == [START, START + 3])
    assert labels.tracks[made]["sightings"] == 4, "the frames between follow"
    expect(page.locator(".track-detail .facts").first).to_contain_text("keyframe")
    hand.keys("x")
    labels.wait_for(lambda now: len(now.tracks) == 2)
    hand.keys("r")
    labels.wait_for(lambda now: now.tracks[made]["state"] == "rejected")
    is_saved(page)

    page.reload()
    is_at(page, START + 3)  # labeling goes on where it was
    expect(page.locator(".track-row")).not_to_have_count(0)
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: now.tracks[made]["state"] != "rejected")
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: len(now.tracks) == 1)
    page.keyboard.press("Control+Shift+Z")
    labels.wait_for(lambda now: len(now.tracks) == 2)


def test_the_lead_is_painted_by_keys_by_number_and_by_a_drag(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    bare = pixels(page, "#timeline-back")
    hand.keys("i", *["f"] * 4)
    is_at(page, START + 4)
    hand.keys("c")
    labels.wait_for(lambda now: now.leads == [(START, START + 4, made)])
    assert repainted(page, "#timeline-back", bare)
    hand.keys("f")
    is_at(page, START + 5)
    hand.keys("u")
    labels.wait_for(lambda now: now.leads == [(START, START + 4, made), (START + 5, START + 5, "unknown")])
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_text("unclear")
    hand.keys("0")
    labels.wait_for(lambda now: now.leads[-1] == (START + 5, START + 5, "none"))

    front = box_of(page.locator("#timeline-front"))
    y = front["y"] + LEADS_Y
    hand.drag((front["x"] + on_timeline(page, 100), y), (front["x"] + on_timeline(page, 120), y), steps=8)
    labels.wait_for(lambda now: (100, 120, made) in now.leads)
    is_at(page, 120)
    hand.keys("Escape", "i")
    go_to(page, 130)
    is_at(page, 130)
    hand.keys(*str(made))
    labels.wait_for(lambda now: (100, 130, made) in now.leads or (121, 130, made) in now.leads)
    hand.keys("Shift+U")
    labels.wait_for(lambda now: now.leads[-1][1] == 129)


def test_everything_said_of_a_frame_has_a_history(hand: Hand, labels: Labels):
    """Including entries that are hidden at first, and new ones while it is open."""
    page = hand.page
    made = draw(hand, labels)
    for label in ("truck", "bus") * 4:
        held = labels.tracks[made]["revision"]
        labels.act("Ada", {"kind": "relabel", "track": made, "revision": held, "label": label})
    acts = len(labels.get(f"/history?kind=track&id={made}"))
    rows = page.locator(".track-detail .past li")
    expect(page.locator(".track-detail .past button")).to_have_text(f"{acts - 6} earlier")
    expect(rows).to_have_count(6)
    page.locator(".track-detail .past button").click()
    expect(rows).to_have_count(acts)
    hand.keys("c")
    labels.act("Ada", {"kind": "tag", "first": START, "last": START, "tag": "night", "on": True})
    labels.act("Ada", {"kind": "add_event", "frame": START, "event": "cut_in", "tracks": [made]})
    page.get_by_role("tab", name="Frame").click()
    pasts = page.locator(".moment-pasts details")
    expect(pasts).to_have_count(3)
    lead = page.locator(".moment-pasts details[data-kind=lead]")
    lead.locator("summary").click()
    expect(lead.locator("li")).to_contain_text([f"Ada: lead of frame {START + 1}: #{made}"])
    (said,) = labels.everything["leads"]
    ends = {"first": START, "last": START + 3, "range": said["id"], "revision": said["revision"]}
    labels.act("Bob", {"kind": "trim_lead", **ends})
    expect(lead.locator("li")).to_have_count(2)
    expect(lead.locator("li").first).to_contain_text("Bob: lead")


def test_proposals_are_accepted_exported_and_scored(hand: Hand, labels: Labels, site: Site):
    page = hand.page
    whole_drive(page, site)
    hand.keys("p")
    labels.wait_for(lambda now: len(now.leads) > 0)
    expect(page.locator(".track-row")).not_to_have_count(0)
    assert {each["state"] for each in labels.tracks.values()} == {"proposed"}
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_count(1)
    only_sure_ones_are_listed(hand, labels)
    hand.keys("Shift+A")
    labels.wait_for(lambda now: any(each["state"] == "accepted" for each in now.everything["leads"]))
    page.get_by_role("tab", name="Score").click()
    expect(page.locator(".label-score .metrics tbody tr")).not_to_have_count(0)
    page.get_by_role("tab", name="Tracks").click()
    page.get_by_role("button", name="To do").click()
    hand.keys("b")
    expect(page.locator(".said")).not_to_be_empty()
    expect(page.locator(".track-detail")).to_be_visible()
    with page.expect_download() as download:
        page.locator("#label-pane").get_by_role("button", name="Export").click()
        page.locator("#menu").get_by_role("button", name="Accepted").click()
        page.locator("#menu").get_by_text("CIPV Studio").click()
    assert download.value.suggested_filename == "labels-native-accepted.json"
    written = json.loads(download.value.path().read_text(encoding="utf-8"))
    accepted = {number for number, each in labels.tracks.items() if each["state"] == "accepted"}
    assert {each["id"] for each in written["labels"]["tracks"]} == accepted


def test_the_outcome_of_a_task_does_not_replace_a_later_answer(hand: Hand, labels: Labels, site: Site):
    """The task proposes labels of two seconds: those of the whole drive take seven seconds of processor time."""
    whole_drive(hand.page, site)
    mark = "async (ends) => (await import('/js/labeling/state/marked_frames.js')).markAll(...ends)"
    hand.page.evaluate(mark, [START, START + 19])
    hand.page.evaluate("""async () => {
        const commands = await import("/js/labeling/acts/commands.js");
        commands.propose();
        commands.say("extended #3");
    }""")
    labels.wait_for(lambda now: len(now.leads) > 0)
    expect(hand.page.locator(".said")).to_have_text(re.compile(r"^extended #3 · proposed \d+ tracks"))
    hand.page.evaluate(mark, [START, START + 19])
    hand.keys("p")
    expect(hand.page.locator(".said")).to_have_text(re.compile(r"^(proposed|nothing|no )"))


def only_sure_ones_are_listed(hand: Hand, labels: Labels) -> None:
    """The slider from none to all; one heading is reversed, and this is undone."""
    page, count = hand.page, len(labels.tracks)
    slider = page.get_by_label("Minimum confidence of proposals")
    slider.fill("1")
    expect(page.locator(".sureness .above")).to_have_text(f"≥ 100 %: 0 proposed, {count} hidden")
    expect(page.locator(".track-row")).to_have_count(0)
    slider.fill("0")
    expect(page.locator(".sureness .above")).to_have_text(f"≥ 0 %: {count} proposed, 0 hidden")
    expect(page.locator(".track-row")).not_to_have_count(0)
    slider.blur()
    hand.keys(".")
    chosen = int(page.locator(".track-row[aria-selected=true]").get_attribute("data-id") or -1)
    before = labels.cuboid(chosen, START)["yaw_rad"]
    hand.keys("Shift+X")
    labels.wait_for(lambda now: math.cos(now.cuboid(chosen, START)["yaw_rad"] - before) < -0.999)
    hand.keys("Control+z")
    labels.wait_for(lambda now: now.cuboid(chosen, START)["yaw_rad"] == before)
    hand.keys("Escape")


def test_a_drive_is_reviewed_frozen_and_taken_back_in(hand: Hand, labels: Labels, tmp_path: Path):
    page = hand.page
    made = draw(hand, labels)
    hand.keys("h")
    dialog = page.get_by_role("dialog", name="Send back")
    dialog.get_by_label("Comment").fill("a metre too long")
    dialog.get_by_role("button", name="OK").click()
    expect(page.locator(".track-detail .comment")).to_have_text("Sent back: a metre too long")
    assert labels.tracks[made]["state"] == "proposed"
    hand.keys("a")
    labels.wait_for(lambda now: now.tracks[made]["state"] == "accepted")

    page.get_by_role("tab", name="Frame").click()
    page.get_by_role("button", name="Cut-in", exact=True).click()
    page.get_by_label("Tag for these frames").fill("rain")
    page.get_by_role("button", name="Add", exact=True).click()
    page.get_by_role("button", name="Draw path").click()
    bare = pixels(page, "#bev")
    hand.drag(hand.plan(1, 0), hand.plan(30, 1), steps=6)
    labels.wait_for(lambda now: len(now.everything["paths"]) == 1)
    assert repainted(page, "#bev", bare)
    expect(page.locator(".moment-row")).to_have_count(2)
    held = labels.everything
    assert [(each["kind"], each["tracks"]) for each in held["events"]] == [("cut_in", [made])]
    assert [each["tag"] for each in held["tags"]] == ["rain"]
    (path,) = held["paths"]
    assert path["left"][0][1] - path["right"][0][1] == pytest.approx(2 * Params().path.half_width_m, abs=0.05)

    page.get_by_role("tab", name="Files").click()
    page.get_by_label("Version name").fill("reviewed")
    page.get_by_role("button", name="Freeze", exact=True).click()
    version = page.locator(".label-files a", has_text="reviewed")
    expect(version).to_be_visible()
    page.get_by_label("Version name").fill("reviewed")
    page.get_by_role("button", name="Freeze", exact=True).click()
    expect(page.locator("#label-files [role=alert]").first).not_to_be_empty()
    expect(page.get_by_label("Version name")).to_have_value("reviewed")
    with page.expect_download() as download:
        version.click()
    download.value.save_as(tmp_path / "reviewed.json")
    key = labels.everything["drive"]["id"]
    work = page.locator(f".queue-row[data-key='{key}']")
    work.get_by_role("button", name="assign to me").click()
    expect(work.get_by_role("button", name="Ada")).to_be_visible()
    work.get_by_role("combobox").select_option("review")
    expect(page.locator(".label-files [role=alert]").last).to_contain_text("nothing is labelled yet")
    expect(work.get_by_role("combobox")).to_have_value("labeling")
    work.get_by_role("button", name="Ada").click()
    expect(work.get_by_role("button", name="assign to me")).to_be_visible()
    page.get_by_role("tab", name="Tracks").click()
    hand.keys("Shift+Delete")
    labels.wait_for(lambda now: not now.tracks)
    page.get_by_role("tab", name="Files").click()
    page.get_by_label("Label file").set_input_files(tmp_path / "reviewed.json")
    page.get_by_role("button", name="Import file").click()
    labels.wait_for(lambda now: len(now.tracks) == 1)
    expect(page.locator(".said")).to_contain_text("1 track")
