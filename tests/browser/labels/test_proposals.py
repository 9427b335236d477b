"""What is only proposed is not labelled yet, and the 3D view is told of every label, drawn by hand or not."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.labels.hands import Hand, Labels, begin, draw, is_at
from tests.browser.looks import COUNT, show_instead

NO_VISER = ("status of 502",)
"""The server in these tests has no 3D view."""
HEAR = """() => {
  window.said = [];
  const { send } = WebSocket.prototype;
  WebSocket.prototype.send = function (message) {
    window.said.push(message);
    return send.call(this, message);
  };
}"""
"""Records what the page sends to the server from now on."""
NEWEST = "Object.assign({}, ...window.said.map((each) => JSON.parse(each)))"
"""The newest message of each kind."""
pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_the_next_unlabelled_frame_is_one_whose_lead_is_only_proposed(hand: Hand, labels: Labels):
    """A label that is returned becomes a proposal again."""
    page = hand.page
    labels.act("Bob", {"kind": "set_lead", "first": 0, "last": COUNT - 1, "lead": "none"})
    hand.keys("n")
    expect(page.locator(".said")).to_have_text("No unlabelled frame after this frame")
    (lead,) = labels.everything["leads"]
    ref = {"kind": "lead", "id": lead["id"], "revision": lead["revision"]}
    labels.act("Bob", {"kind": "send_back", "items": [ref], "comment": "look again"})
    hand.keys("n")
    is_at(page, START + 1)
    expect(page.locator(".said")).to_contain_text("lead only proposed")
    labels.clear(COUNT)


def test_accept_means_the_lead_once_the_selected_track_is_accepted(hand: Hand, labels: Labels):
    """Whoever presses N and A in turn must not be told that nothing changed."""
    made, row = draw(hand, labels), hand.page.locator(".track-row[aria-selected=true]")
    labels.act("Bob", {"kind": "set_lead", "first": 0, "last": COUNT - 1, "lead": made})
    (lead,) = labels.everything["leads"]
    ref = {"kind": "lead", "id": lead["id"], "revision": lead["revision"]}
    labels.act("Bob", {"kind": "send_back", "items": [ref], "comment": "look again"})
    expect(row).to_have_attribute("data-id", str(made))
    expect(hand.page.locator(".leads button.is-proposed")).to_have_count(1)
    hand.keys("a")
    labels.wait_for(lambda now: now.everything["leads"][0]["state"] == "accepted")
    (lead,) = labels.everything["leads"]
    labels.act("Bob", {"kind": "send_back", "items": [{**ref, "revision": lead["revision"]}], "comment": "and again"})
    hand.keys("n")
    is_at(hand.page, START + 1)
    expect(row, "the next frame is about its lead").to_have_count(0)


def test_a_search_that_finds_nothing_names_what_it_looked_for(hand: Hand):
    hand.page.get_by_role("button", name="Queued", exact=True).click()
    expect(hand.page.locator(".said")).to_have_text("No queued frame after this frame")


def test_while_labels_are_proposed_the_list_says_so_and_offers_it_no_second_time(hand: Hand):
    propose = hand.page.locator(".begin")
    expect(propose).to_be_visible()
    task = {"id": 900, "what": "propose", "done": 8, "total": 100, "note": "", "error": None, "running": True}
    show_instead(hand.page, state={"labels": {"task": task}})
    expect(hand.page.locator(".track-list")).to_contain_text("Proposing labels: 8 of 100 …")
    expect(propose).to_be_hidden()
    show_instead(hand.page, state={"labels": {"task": task | {"running": False}}})
    expect(propose).to_be_visible()


def test_once_all_frames_are_computed_the_message_says_that_labels_can_be_proposed(hand: Hand):
    """Until then, only the computed frames were offered."""
    page = hand.page
    page.evaluate(
        """async () => {
          const { set } = await import("/js/core/store.js");
          window.isComputed = false;
          set("said", "not computed");
          const offer = { words: "Propose", take: () => null, isOpen: () => !window.isComputed };
          set("offer", { ...offer, about: "not computed", after: "computed" });
        }"""
    )
    expect(page.locator(".offer")).to_be_visible()
    expect(page.locator(".said")).to_have_text("not computed")
    page.evaluate(
        """async () => {
          const { get, set } = await import("/js/core/store.js");
          window.isComputed = true;
          set("drive", { ...get("drive") });
        }"""
    )
    expect(page.locator(".offer")).to_be_hidden()
    expect(page.locator(".said")).to_have_text("computed")


def test_the_3d_view_is_told_of_labels_with_class_number_and_state_and_of_the_selected_one(
    open_page: OpenPage, site: Site
):
    page = open_page(expects=NO_VISER)
    page.evaluate(HEAR)
    labels, hand = Labels(page, site.address), begin(page)
    labels.clear(COUNT)
    page.get_by_role("button", name="Here", exact=True).click()
    page.evaluate("async (index) => (await import('/js/drive/seek.js')).seekTo(index)", START)
    is_at(page, START)
    made = draw(hand, labels)
    text = f"#{made} car, corrected"
    page.get_by_role("tab", name="3D").click()
    page.wait_for_function(f"(text) => {NEWEST}.labels_3d?.labels.map((each) => each.text).join() === text", arg=text)
    told = page.evaluate(NEWEST)
    assert told["labels_3d"]["alone"], "the pipeline's objects are hidden"
    assert (told["held"]["track"], told["held"]["frame"]) == (made, START), "the camera goes to it"
    hand.keys("Escape")
    page.wait_for_function(f"() => {NEWEST}.held === null")
    page.get_by_role("tab", name="Plan").click()
    page.wait_for_function(f"() => {NEWEST}.labels_3d === null")
