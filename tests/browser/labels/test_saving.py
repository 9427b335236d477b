"""What is called saved is on the server's disk, whatever happens on the way there and whoever else is at work."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.labels.conftest import Line
from tests.browser.labels.hands import Hand, Labels, begin, draw, is_at, is_saved
from tests.browser.looks import wait_for_frame

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_two_people_see_each_other_and_choose_when_they_disagree(
    hand: Hand, labels: Labels, line: Line, open_page: OpenPage, site: Site
):
    while hand.page.request.post(f"{site.address}/api/params/undo").ok:
        pass  # parameters changed by nobody in particular are everybody's to take back
    made = draw(hand, labels)
    is_saved(hand.page)
    other = open_page()
    wait_for_frame(other, START)
    second = begin(other, "Cleo")  # has done nothing in other tests that could be taken back
    second.keys("Home")
    is_at(other, 0)
    is_at(hand.page, START)  # each has a playhead of its own, and watchers stay where they are
    assert site.engine.snapshot.index == START
    second.keys("ArrowRight")
    is_at(other, 1)
    other.get_by_role("button", name="Follow", exact=True).click()
    is_at(other, START)
    row = other.locator(f".track-row[data-id='{made}']")
    expect(row).to_contain_text("car")
    row.click()
    undo = other.get_by_role("button", name="Undo your last change")
    expect(undo).to_be_disabled()  # what Ada did is hers to take back
    second.keys("t")
    expect(undo).to_be_enabled()
    expect(hand.page.locator(f".track-row[data-id='{made}']")).to_contain_text("truck")

    line.deaf = True  # the other's change does not reach this page before its own act
    labels.act("Cleo", {"kind": "relabel", "track": made, "revision": labels.tracks[made]["revision"], "label": "bus"})
    hand.keys("Shift+T")
    dialog = hand.page.get_by_role("dialog", name="Two people changed the same label")
    expect(dialog).to_contain_text("Cleo")
    expect(dialog).to_contain_text("bus")
    assert labels.tracks[made]["label"] == "bus", "nothing was written"
    line.deaf = False
    dialog.get_by_role("button", name="Keep mine").click()
    labels.wait_for(lambda now: now.tracks[made]["label"] == "car")
    is_saved(hand.page)
    assert [each["person"] for each in labels.get(f"/history?kind=track&id={made}")] == ["Ada", "Cleo", "Cleo", "Ada"]


def test_leads_that_overlap_are_a_conflict_shown_with_both_ranges(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    labels.act("Bob", {"kind": "set_lead", "first": START + 4, "last": START + 9, "lead": "unknown"})
    expect(page.locator(".leads button").first).to_be_visible()
    line.deaf = True  # the other's change does not reach this page before its own act
    labels.act("Bob", {"kind": "set_lead", "first": START, "last": START + 3, "lead": "unknown"})
    hand.keys("0")
    dialog = page.get_by_role("dialog", name="Two people changed the same label")
    expect(dialog).to_contain_text(f"Bob changed the lead of frame {START + 1} since")
    expect(dialog.locator(".conflict-range")).to_have_count(2)
    assert [each[2] for each in labels.leads] == ["unknown"], "nothing was written"
    line.deaf = False
    dialog.get_by_role("button", name="Keep mine").click()
    labels.wait_for(lambda now: (START, START, "none") in now.leads)
    is_saved(page)


def test_what_is_called_saved_is_what_the_server_answered(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    state = page.locator(".saved")
    before = labels.cuboid(made, START)
    line.full = True
    hand.keys("ArrowUp")
    expect(state).to_have_text("not saved: the disk is full")
    assert labels.cuboid(made, START) == before
    line.full = False
    page.get_by_role("button", name="Retry").click()
    labels.wait_for(lambda now: now.cuboid(made, START)["center"][0] == pytest.approx(before["center"][0] + 0.1))
    expect(state).to_contain_text("saved ")


def test_an_act_whose_answer_was_lost_is_done_once(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    line.mute = True
    hand.keys("t")
    expect(page.locator(".saved")).to_have_text("not saved: cannot reach the server")
    done = labels.get(f"/history?kind=track&id={made}")
    line.mute = False
    page.get_by_role("button", name="Retry").click()
    is_saved(page)
    assert labels.get(f"/history?kind=track&id={made}") == done
    assert len(done) == 2


def test_what_the_server_fails_at_or_a_person_gives_up_holds_nothing_up(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    line.broken = True
    hand.keys("t")
    expect(page.locator(".said")).to_have_text("the server answered 500")
    line.broken, line.full = False, True
    hand.keys("t")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    line.full = False
    page.get_by_role("button", name="Discard").click()
    is_saved(page)
    assert labels.tracks[made]["label"] == "car"
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")


def test_what_follows_an_undo_that_waits_is_no_conflict_with_oneself(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")
    is_saved(page)
    line.full = True
    hand.keys("Control+z")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    before = labels.cuboid(made, START)["center"][0]
    line.full = False
    hand.keys("ArrowUp")  # based on what the page knows: the undo has not been answered yet
    labels.wait_for(lambda now: now.cuboid(made, START)["center"][0] == pytest.approx(before + 0.1))
    assert labels.tracks[made]["label"] == "car"
    expect(page.get_by_role("dialog")).to_be_hidden()


def test_the_labels_of_another_database_are_read_anew(hand: Hand, labels: Labels):
    """As after a restart of the server, when it has less than the page."""
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    page.evaluate(
        """async (made) => {
          const { get, set } = await import("/js/core/store.js"), labels = get("labels");
          const tracks = new Map(labels.tracks).set(99999, { ...labels.tracks.get(made), id: 99999 });
          set("labels", { ...labels, tracks, revision: labels.revision + 50 });
        }""",
        made,
    )
    page.get_by_role("button", name="All", exact=True).click()
    expect(page.locator(".track-row[data-id='99999']")).to_be_visible()
    page.evaluate("""async () => { (await import("/js/labeling/state/sync.js")).look(); }""")
    expect(page.locator(".track-row[data-id='99999']")).to_have_count(0)
    expect(page.locator(f".track-row[data-id='{made}']")).to_be_visible()


def test_the_small_rules_of_sending(hand: Hand):
    """A page without ``randomUUID``; two requests without parameters while one is pending; two items with the same
    id."""
    page = hand.page
    made = page.evaluate(
        """async () => {
          const { newId } = await import("/js/labeling/acts/queue.js"), own = newId();
          Object.defineProperty(crypto, "randomUUID", { value: undefined, configurable: true });
          const ids = [own, newId(), newId()];
          delete crypto.randomUUID;
          return ids;
        }"""
    )
    assert len(set(made)) == 3
    assert all(
        re.fullmatch(r"[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}", each) for each in made
    )
    sent = page.evaluate(
        """async () => {
          const { newestOnly } = await import("/js/core/api.js"), waits = [];
          let sent = 0;
          const submit = newestOnly(() => new Promise((done) => { sent += 1; waits.push(done); }));
          const first = submit(undefined);
          submit(undefined);
          submit(undefined);
          waits[0]();
          for (let turn = 0; turn < 100 && waits.length < 2; turn += 1) await null;
          waits[1]?.();
          await first;  // answered is what was submitted, and what waited with it
          return sent;
        }"""
    )
    assert sent == 2
    page.evaluate(
        """async () => {
          const { choose } = await import("/js/labeling/acts/conflict.js");
          const items = [{ kind: "track", id: 3, revision: 5 }, { kind: "lead", id: 3, revision: 6 }];
          const item = { kind: "track", id: 3 }, theirs = { id: 3, revision: 9, first: 27, last: 38 };
          window.chosen = choose({ kind: "accept", items }, "Bob changed #3 since", item, theirs);
        }"""
    )
    expect(page.locator(".conflict dd")).to_have_text(["28", "39"])
    page.get_by_role("button", name="Keep mine").click()
    assert [each["revision"] for each in page.evaluate("async () => (await window.chosen).items")] == [9, 6]
