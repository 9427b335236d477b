"""Whole tasks of an engineer: find where the lead changed and why, try a threshold, pass on what was found."""

from __future__ import annotations

import json
import re
from urllib.parse import parse_qs, quote, urlsplit

import pytest
from playwright.sync_api import Page, Route, expect

from pipeline.params import Params
from tests.browser.conftest import START, WAIT_MS, OpenPage, Site
from tests.browser.looks import COUNT, box_of, go_to, on_timeline, pixels, repainted, table, wait_for_frame

WAIT_S = WAIT_MS / 1e3
WIDE = {"path.half_width_m": 3.5}
"""A corridor this wide includes the cars in the next lane."""

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


@pytest.fixture
def page(open_page: OpenPage, site: Site, paused_in_traffic: None) -> Page:
    """The dashboard after the whole drive was computed."""
    site.engine.wait_for(lambda s: s.drive.done == s.drive.total == COUNT, WAIT_S)
    recording = site.engine.drives.recording
    assert recording is not None
    assert recording.runs.current is not None
    recording.runs.compare_with(recording.runs.current.number)
    site.engine.drives.changed()
    page = open_page()
    wait_for_frame(page, START)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")
    return page


def test_find_where_the_lead_changed_and_say_why(page: Page, site: Site):
    events = page.request.get(f"{site.address}/api/drive/events").json()["events"]
    ids = page.request.get(f"{site.address}/api/drive?from=0").json()["columns"]["cipv_id"]
    place, at = next((k, e["index"]) for k, e in enumerate(events) if e["kind"] in {"cipv_switch", "cut_in", "cut_out"})
    assert ids[at - 1] != ids[at], "the lead changed there"
    page.locator("#events .event").nth(place).click()
    wait_for_frame(page, at)
    shown = site.engine.wait_for(lambda s: s.index == at, WAIT_S)
    assert shown.processed is not None
    result = shown.processed.result
    assert result.cipv is not None
    assert (result.cipv.id, at) == (ids[at], shown.index), "the page shows what the continuous run found"

    page.keyboard.press("Escape")
    expect(page.locator("#why .verdict")).to_have_text(result.cipv.reason)
    expect(page.locator("#why .ranked").first).to_contain_text(f"#{ids[at]}")

    stopped = next(each for each in result.rejected if not each.reason.startswith("behind"))
    page.locator(f"#objects tr[data-id='{stopped.id}']").click()
    expect(page.locator("#why-facts")).to_have_text("this is not the CIPV")
    expect(page.locator("#why .verdict")).to_contain_text(f"Not the CIPV: {stopped.reason}")
    gates = next(item.gates for item in result.objects if item.id == stopped.id)
    failed = sum(not gate.passed for gate in gates)
    expect(page.locator("#why .gate[data-passed=no]")).to_have_count(failed)
    assert page.locator("#why .gate").evaluate_all("rows => rows.map((row) => row.dataset.passed)") == (
        ["no"] * failed + ["yes"] * (len(gates) - failed)
    ), "what stopped it stands first"


def test_a_changed_threshold_is_seen_at_once_and_over_the_whole_drive(page: Page, site: Site):
    ribbon, lead = pixels(page, "#timeline-back"), table(page)
    page.locator("[data-param='path.half_width_m'] input[type=range]").evaluate(
        "(range) => { range.closest('details').open = true; range.scrollIntoView() }"
    )
    page.locator("[data-param='path.half_width_m'] input[type=range]").fill(str(WIDE["path.half_width_m"]))
    expect(page.locator("#objects tbody")).not_to_have_text(lead)
    expect(page.locator("#timeline-facts")).to_contain_text("frames differ")
    assert repainted(page, "#timeline-back", ribbon)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")
    page.get_by_role("tab", name="Runs").click()
    expect(page.locator(".run.is-now .run-label")).to_contain_text("path.half_width_m")
    expect(page.locator(".metrics tbody tr")).not_to_have_count(0)
    comparison = page.request.get(f"{site.address}/api/compare").json()
    expect(page.locator(".comparison")).to_contain_text(f"{comparison['frames_differing']} of {COUNT} frames differ")

    go_to(page, COUNT - 1)
    wait_for_frame(page, COUNT - 1)
    page.keyboard.press("Shift+X")
    wait_for_frame(page, [first for first, _ in comparison["differing"] if first < COUNT - 1][-1])

    page.locator(".run.is-now").get_by_label("Run name").fill("wide corridor")
    page.locator(".run.is-now").get_by_label("Run name").blur()
    expect(page.locator(".run.is-now .tag")).to_contain_text("kept")
    page.keyboard.press("Control+z")
    site.engine.wait_for(lambda s: s.params == Params(), WAIT_S)
    expect(page.locator("#timeline-facts")).to_have_text("")
    assert repainted(page, "#timeline-back", ribbon, like=True), "undone, the ribbon is the old one"
    page.keyboard.press("Control+Shift+Z")
    site.engine.wait_for(lambda s: s.params.path.half_width_m == WIDE["path.half_width_m"], WAIT_S)
    kept = page.locator(".run", has=page.locator(".run-top .tag", has_text="kept"))
    expect(kept.get_by_label("Run name")).to_have_value("wide corridor")


def test_a_link_restores_moment_selection_parameters_and_layout(page: Page, site: Site, open_page: OpenPage):
    site.engine.control.change_params(WIDE)
    go_to(page, 90)
    wait_for_frame(page, 90)
    page.locator("#objects tbody tr").nth(1).click()
    chosen = page.locator("tr.is-selected td").first.inner_text()
    page.keyboard.press("4")
    expect(page.locator("[data-section=path] .count")).to_have_text("1 changed")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    share, box = page.locator("#share-button"), box_of(page.locator("#share-button"))
    page.keyboard.press("c")
    expect(share.locator("> *").last).to_be_visible()
    assert box_of(share) == box, "and nothing beside it moves"
    expect(page.locator("#announcement")).to_have_text("Link copied")
    link = page.evaluate("navigator.clipboard.readText()")
    query = parse_qs(urlsplit(link).fragment)
    assert query["uri"] == ["sim:straight"]
    assert json.loads(query["params"][0]) == WIDE

    site.engine.control.set_params(Params())
    site.engine.control.seek(0)
    site.engine.wait_for(lambda s: s.index == 0 and s.params == Params(), WAIT_S)
    second = open_page(address=link)
    dialog = second.get_by_role("dialog", name="Link")
    expect(dialog).to_contain_text("change path.half_width_m")
    assert site.engine.snapshot.params == Params(), "a link changes nothing of others unasked"
    dialog.get_by_role("button", name="Continue").click()
    wait_for_frame(second, 90)
    site.engine.wait_for(lambda s: s.params.path.half_width_m == WIDE["path.half_width_m"], WAIT_S)
    expect(second.locator(".table-pane")).to_be_hidden()
    second.keyboard.press("4")
    expect(second.locator("tr.is-selected td").first).to_have_text(chosen)
    assert urlsplit(second.url).fragment == "", "a reload does not turn back time"


def test_a_link_to_a_moment_stops_there(open_page: OpenPage, site: Site):
    site.engine.control.change(playing=True)
    site.engine.wait_for(lambda s: s.playing, WAIT_S)
    open_page(address=f"{site.address}/#uri=sim%3Astraight&frame=90")
    site.engine.wait_for(lambda s: s.index == 90 and not s.playing, WAIT_S)


def test_a_link_to_another_file_asks_first(open_page: OpenPage, site: Site):
    page = open_page(address=f"{site.address}/#uri=kitti%3A%2Fnowhere&frame=3")
    dialog = page.get_by_role("dialog", name="Link")
    expect(dialog).to_contain_text("kitti:/nowhere")
    dialog.get_by_role("button", name="Cancel").click()
    assert site.engine.snapshot.uri == "sim:straight"


def test_a_link_with_a_broken_layout_still_leads_to_its_moment(open_page: OpenPage, site: Site):
    layout = quote(json.dumps({"hidden": None, "tab": 7, "grown": "nowhere", "sizes": {"timeline": "x"}, "layers": 3}))
    page = open_page(address=f"{site.address}/#uri=sim%3Astraight&frame=33&layout={layout}")
    wait_for_frame(page, 33)
    expect(page.locator(".camera-pane")).to_be_visible()


def test_a_clip_is_marked_and_exported(page: Page):
    go_to(page, 40)
    wait_for_frame(page, 40)
    page.keyboard.press("i")
    go_to(page, 49)
    wait_for_frame(page, 49)
    page.keyboard.press("o")
    expect(page.locator("#clip-facts")).to_contain_text("frames 41–50")
    page.locator("#export-button").click()
    page.locator("#menu").get_by_role("button", name="CSV").click()
    file = page.locator("#menu .job a").first
    expect(file).to_be_visible()
    with page.expect_download() as download:
        file.click()
    heading, *rows = download.value.path().read_text(encoding="utf-8").splitlines()
    assert heading.startswith("frame,")
    assert {row.split(",")[0] for row in rows} == {f"{index:06d}" for index in range(40, 50)}


def test_a_moment_is_marked_and_found_again(page: Page):
    page.keyboard.press("t")
    mark = page.locator("#events .event", has_text="Mark")
    expect(mark).to_have_count(1)
    go_to(page, 10)
    wait_for_frame(page, 10)
    mark.click()
    wait_for_frame(page, START)
    page.locator("#events").get_by_role("button", name="Remove mark").click()
    expect(mark).to_have_count(0)


def test_dragging_along_the_timeline_goes_along(page: Page):
    front = page.locator("#timeline-front")
    at = box_of(front)
    y = at["y"] + at["height"] - 16
    page.mouse.move(at["x"] + on_timeline(page, 20), y)
    page.mouse.down()
    page.mouse.move(at["x"] + on_timeline(page, 120), y, steps=12)
    page.mouse.up()
    wait_for_frame(page, 120)
    expect(front).to_have_attribute("aria-valuenow", "120")


def test_the_timeline_zooms_and_fits(page: Page):
    whole = pixels(page, "#timeline-back")
    page.locator("#timeline-front").hover()
    page.mouse.wheel(0, -600)
    assert repainted(page, "#timeline-back", whole)
    page.get_by_role("button", name="Fit").click()
    assert repainted(page, "#timeline-back", whole, like=True)


def test_the_ribbon_selects_who_was_the_lead(page: Page, site: Site):
    ids = page.request.get(f"{site.address}/api/drive?from=0").json()["columns"]["cipv_id"]
    at = next(i for i in range(100, COUNT) if ids[i] is not None)
    page.locator("#timeline-front").click(position={"x": on_timeline(page, at), "y": 36})
    wait_for_frame(page, at)
    expect(page.locator("tr.is-selected td").first).to_have_text(f"#{ids[at]}")


def test_a_change_that_is_taken_back_while_its_figures_are_on_their_way_is_no_complaint(page: Page, site: Site):
    """The run no longer exists when the server is asked about it; the fixture checks that nothing was refused."""
    recording = site.engine.drives.recording
    assert recording is not None
    registry = recording.runs
    base = registry.base
    assert base is not None
    asked: list[Route] = []
    page.route(re.compile("/api/compare"), lambda route: route.continue_() if asked else asked.append(route))
    site.engine.control.change_params(WIDE)
    while not asked:
        page.evaluate("() => new Promise(requestAnimationFrame)")
    gone = registry.current
    assert gone is not None
    assert gone is not base
    site.engine.control.set_params(Params(), "default")
    site.engine.wait_for(lambda s: s.drive.run == base.number, WAIT_S)
    if gone in registry.all():
        registry.delete(gone.number)
    with page.expect_response(re.compile("/api/compare")):
        asked[0].continue_()
    expect(page.locator("#timeline-facts")).not_to_contain_text("frames differ")


def test_the_cloud_is_dragged_over_the_image(page: Page, site: Site):
    page.keyboard.press("a")
    expect(page.locator("#align-bar .score")).to_have_text(re.compile(r"\d+ %"))
    image = box_of(page.locator("#camera"))
    x, y = image["x"] + image["width"] / 2, image["y"] + image["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y - 20, steps=5)
    page.mouse.up()
    moved = site.engine.wait_for(
        lambda s: s.params.alignment.yaw_deg > 0.2 and s.params.alignment.pitch_deg > 0.1, WAIT_S
    )
    assert moved.params.alignment.model == "pinhole"
    page.keyboard.press("Control+z")
    site.engine.wait_for(lambda s: s.params == Params(), WAIT_S)
    blended = pixels(page, "#camera")
    page.get_by_label("Blend image and point cloud").fill("1")
    assert repainted(page, "#camera", blended)
    page.keyboard.press("a")
    expect(page.locator("#align-bar")).to_be_hidden()


def test_what_is_shown_is_recorded(page: Page, site: Site):
    page.get_by_role("button", name="Record").click()
    recording = site.engine.wait_for(lambda s: s.recording is not None, WAIT_S).recording
    assert recording is not None
    page.keyboard.press("ArrowRight")
    wait_for_frame(page, START + 1)
    page.get_by_role("button", name="Stop recording").click()
    site.engine.wait_for(lambda s: s.recording is None, WAIT_S)
    assert recording.file.stat().st_size > 0
    expect(page.get_by_role("button", name="Record")).to_have_attribute("aria-pressed", "false")
