"""The queue shows projects: their progress, each person's work, and their recordings alone."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from app.labels.projects.control import pack_truth
from app.labels.projects.project_file import ProjectEntries, ProjectFile
from app.labels.projects.sampling import Sampling
from app.labels.projects.store import ControlSpan, put_project
from pipeline.labels.model import LabelSet, LeadRange, Origin
from tests.browser.conftest import START, Site
from tests.browser.labels.hands import Hand, Labels, is_at

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_projects_are_shown_with_progress_people_and_results_of_control_frames(hand: Hand, labels: Labels, site: Site):
    page, database = hand.page, site.engine.labels.kept.opened()
    info = site.engine.labels.labels.info
    names = tuple(map(str, range(len(info.t_ns))))
    truth = LabelSet("x", names, info.t_ns, leads=(LeadRange(0, 9, "none", "accepted", Origin("import", "x", 1)),))
    entries = ProjectEntries(name="Winter", drives=[info.uri], sampling=Sampling(every_s=2))
    span = ControlSpan(info.key, 0, 9, pack_truth(truth, 0, 9))
    put_project(database, ProjectFile(entries, "", (truth,)), [info.key], [span], "Eve")
    empty = ProjectEntries(name="Empty", drives=[info.uri])
    put_project(database, ProjectFile(empty, "", ()), [], [], "Eve")
    labels.act("Eve", {"kind": "tag", "first": 0, "last": 3, "tag": "label next", "on": True})
    labels.act("Bob", {"kind": "set_lead", "first": 0, "last": 1, "lead": "none"})

    page.get_by_role("tab", name="Files").click()
    row = page.locator(".project-row[data-project=Winter]")
    expect(row).to_contain_text("2 of 4 queued frames labelled · 0 of 1 recordings done · one frame every 2 s")
    expect(row).to_contain_text("Bob: ")
    expect(row).to_contain_text("lead right in 100 % of 2 frames")
    expect(row.get_by_role("progressbar", name="Progress of Winter")).to_have_js_property("value", 2)
    expect(page.locator(".queue-row")).to_have_count(1)
    page.get_by_label("Project", exact=True).select_option("Empty")
    expect(page.locator(".queue-row")).to_have_count(0)
    page.get_by_label("Project", exact=True).select_option("Winter")
    expect(page.locator(".queue-row")).to_have_count(1)


def test_who_signed_in_has_the_name_and_role_of_the_account(hand: Hand, labels: Labels):
    """What the server tells a labeler's page."""
    page = hand.page
    page.route("**/api/account", lambda route: route.fulfill(json={"name": "Rita", "role": "labeler"}))
    page.route("**/api/labels/queue", lambda route: route.fulfill(json=[{**_WORK, "person": "Bob"}]))
    page.reload()
    expect(page.locator("#label-bar")).to_contain_text("Rita · labeler")
    page.get_by_role("tab", name="Files").click()
    row = page.locator(".queue-row")
    expect(row.get_by_role("button", name="Bob")).to_be_disabled()
    assert row.locator("option[value=done]").evaluate("(node) => node.disabled")
    page.keyboard.press("Shift+R")
    expect(page.locator(".said")).to_have_text("Requires the role reviewer")
    page.unroute("**/api/account")
    page.unroute("**/api/labels/queue")
    page.reload()
    expect(page.locator("#label-bar")).to_contain_text("Ada")


_WORK = {
    "key": "another", "title": "Another", "uri": "sim:cut_in", "frames": 100, "state": "labeling", "labelled": 0.0,
    "reviewed": 0.0, "proposals": 0, "asked": 0, "worth": 0.0, "sampled": 0, "project": "", "efforts": [],
    "open_proposals": 0, "unreviewed": 0,
}  # fmt: skip


def test_a_recording_with_labels_to_review_is_not_done_and_one_press_goes_there(hand: Hand, labels: Labels):
    page = hand.page
    labels.act("Bob", {"kind": "set_lead", "first": START - 4, "last": START - 2, "lead": "none"})
    page.get_by_role("tab", name="Files").click()
    row = page.locator(".queue-row")
    expect(row).to_contain_text("0 proposals, 1 label not reviewed")
    state = row.get_by_role("combobox")
    before = state.input_value()
    state.select_option("done")
    expect(row.get_by_role("alert")).to_contain_text("is not done: 1 label is not reviewed")
    expect(state).to_have_value(before)
    row.get_by_role("button", name="Go to the first").click()
    is_at(page, START - 4)
    expect(page.locator(".said")).to_have_text("the lead none by Bob")
    row.get_by_role("button", name="Mark as done anyway").click()
    expect(state).to_have_value("done")
    expect(row.get_by_role("alert")).to_have_count(0)
    state.select_option("open")
    expect(state).to_have_value("open")


def test_a_reviewer_cannot_mark_it_as_done_anyway(hand: Hand, labels: Labels):
    """What the server tells a reviewer's page."""
    page = hand.page
    page.route("**/api/account", lambda route: route.fulfill(json={"name": "Rita", "role": "reviewer"}))
    labels.act("Bob", {"kind": "set_lead", "first": 0, "last": 3, "lead": "none"})
    page.reload()
    expect(page.locator("#label-bar")).to_contain_text("Rita · reviewer")
    page.get_by_role("tab", name="Files").click()
    row = page.locator(".queue-row")
    row.get_by_role("combobox").select_option("done")
    expect(row.get_by_role("button", name="Go to the first")).to_be_visible()
    expect(row.get_by_role("button", name="Mark as done anyway")).to_be_hidden()
    page.unroute("**/api/account")
    page.reload()
    expect(page.locator("#label-bar")).to_contain_text("Ada")
