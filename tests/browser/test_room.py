"""Where there is little room: what matters most is still whole."""

from __future__ import annotations

from itertools import pairwise

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.looks import show_instead, wait_for_frame, whole_drive

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

CUT = "(selector) => [...document.querySelectorAll(selector)].filter((node) => node.scrollWidth > node.clientWidth)\
  .map((node) => node.textContent)"
"""Texts of which only the beginning is seen."""


@pytest.mark.parametrize("width", [1440, 1280])
def test_the_name_of_the_recording_and_the_reasons_of_objects_are_whole(
    width: int, open_page: OpenPage, site: Site
) -> None:
    page = open_page(width, 720)
    wait_for_frame(page, START)
    page.evaluate("document.querySelector('#source-title').textContent = '2011_09_26_drive_0009_sync'")
    assert page.evaluate(CUT, "#source-title") == []
    expect(page.locator("#vitals dd").first).to_be_in_viewport()
    expect(page.locator("#objects td.reason").first).to_be_visible()
    page.locator("#objects td.reason").nth(1).evaluate("(cell) => (cell.textContent = 'out of path by 11.4 m')")
    assert page.locator("#objects td.reason").nth(1).evaluate("(cell) => cell.scrollWidth <= cell.clientWidth")
    assert page.locator("#objects").evaluate("(table) => table.offsetWidth <= table.parentElement.clientWidth")


def test_an_event_is_told_to_its_end(open_page: OpenPage, site: Site) -> None:
    page = open_page()
    whole_drive(page, site)
    expect(page.locator(".event .what").first).not_to_be_empty()
    assert page.evaluate(CUT, ".event .what") == []


SIZES = ((720, 450), (900, 700), (1024, 600), (1024, 768), (390, 844))
"""Of the page in pixels: a screen of 1440 × 900 at 200 %, a half screen, two small ones and a phone."""


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_all_of_the_top_bar_is_in_view_or_in_its_menu_and_every_chip_is(
    width: int, height: int, open_page: OpenPage
) -> None:
    page = open_page(width, height)
    bar, more = page.locator(".topbar"), page.get_by_role("button", name="More")
    for control in bar.locator("button:visible").all():
        expect(control).to_be_in_viewport(ratio=1)
    for chip in page.locator(".camera-pane .chips button:visible, .bev-pane .chips button:visible").all():
        expect(chip).to_be_in_viewport(ratio=1)
    tools = page.locator("[aria-label='plan tools']")
    rows = tools.locator("button, select").evaluate_all("all => new Set(all.map((one) => one.offsetTop)).size")
    assert rows == 1, "the plan has more room than its tools"
    names = ("Fleet", "Align", "Layout ▾", "Share", "Help")
    if more.is_visible():
        more.click()
        bar = page.get_by_role("dialog", name="More")
    for name in names:
        expect(bar.get_by_text(name, exact=True)).to_be_in_viewport(ratio=1)


def test_the_menu_of_the_top_bar_is_used_with_keys(open_page: OpenPage) -> None:
    page = open_page(720, 450)
    wait_for_frame(page, START)
    more, menu = page.get_by_role("button", name="More"), page.locator("#menu")
    more.press("Enter")
    expect(menu.get_by_text("Fleet")).to_be_focused()
    page.keyboard.press("Escape")
    expect(menu).to_be_hidden()
    expect(more).to_be_focused()
    more.press("Enter")
    menu.get_by_text("Align").press("Enter")
    expect(menu).to_be_hidden()
    expect(page.locator("#align-bar")).to_be_visible()
    more.press("Enter")
    expect(menu.get_by_text("Align")).to_have_attribute("aria-pressed", "true")
    menu.get_by_text("Layout").press("Enter")
    expect(menu.get_by_role("checkbox", name="Camera")).to_be_focused()
    expect(more).to_have_attribute("aria-expanded", "false")


def test_share_in_the_menu_says_that_it_has_copied(open_page: OpenPage) -> None:
    page = open_page(720, 450)
    wait_for_frame(page, START)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="More").click()
    page.locator("#menu .share").click()
    expect(page.locator("#menu").get_by_text("Copied")).to_be_visible()
    assert "frame=60" in page.evaluate("navigator.clipboard.readText()")


def show_other(page: Page, *, image: bool, points: bool) -> None:
    """A frame of another recording."""
    frame = {"image": {"width": 640, "height": 360} if image else None, "count": 9 if points else 0}
    show_instead(page, state={"uri": "pcap:no-camera"}, frame=frame)


def test_what_a_recording_has_no_sensor_for_is_not_offered(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_frame(page, START)
    chips, tools = page.locator("#camera-layers"), page.locator(".view-tools[data-view=camera]")
    points = page.locator("[data-layer=points], [data-layer=cuboids], [data-layer=planPoints], #bev ~ * .color-by")
    expect(points.locator("visible=true")).to_have_count(4)
    show_other(page, image=False, points=False)
    expect(chips).to_be_hidden()
    expect(tools).to_be_hidden()
    show_other(page, image=True, points=False)
    expect(chips).to_be_visible()
    expect(points.locator("visible=true")).to_have_count(0)
    show_other(page, image=False, points=True)
    expect(chips).to_be_visible()
    expect(points.locator("visible=true")).to_have_count(4)


REASONS = ("beside or behind the bumper", "out of path by 11.4 m", "17 by 4 m: not a vehicle")


def test_the_ranking_of_candidates_tells_the_usual_reasons_to_their_end(open_page: OpenPage, site: Site) -> None:
    page = open_page()
    whole_drive(page, site)
    what = page.locator(".ranked .what")
    expect(what.first).to_be_visible()
    for reason in REASONS:
        assert what.first.evaluate(
            "(node, words) => ((node.textContent = words), node.scrollWidth <= node.clientWidth)", reason
        ), reason
    far = page.locator(".ranked .far").first
    assert far.evaluate("(node) => ((node.textContent = '101.6 m'), node.scrollWidth <= node.clientWidth)")


TICKS = """async () => {
  const { drawAxis } = await import("/js/timeline/axis.js");
  const { get, set } = await import("/js/core/store.js");
  const drive = get("drive"), written = [];
  const t_s = drive.t_s.map((_, k) => 0.1035 * k + 0.004 * (k % 3));
  const line = { beginPath() {}, moveTo() {}, lineTo() {}, stroke() {} };
  const ctx = { ...line, fillText: (words, x) => written.push([words, x]) };
  const left = 132, width = 900, perFrame = width / t_s.length;
  const span = { left, width, perFrame, x: (k) => left + k * perFrame };
  set("drive", { ...drive, t_s });
  drawAxis(ctx, { width: 1040, height: 200 }, span, { lanes: [], axis: { top: 0 }, bar: { height: 8 } });
  set("drive", drive);
  return written;
}"""
"""The seconds along the top for a drive whose frames are at no round times."""


def test_the_timelines_ticks_are_at_round_times_and_equally_far_apart(open_page: OpenPage, site: Site) -> None:
    page = open_page()
    whole_drive(page, site)
    ticks = page.evaluate(TICKS)
    assert [words for words, _ in ticks] == [f"0:{2 * k:02d}.0" for k in range(len(ticks))]
    gaps = [after[1] - before[1] for before, after in pairwise(ticks)]
    assert max(gaps) - min(gaps) < 2.0


LEAST_PLAN = 4
"""Height of the plan in heights of the tools that lie on it."""
OUTSIDE = """() => [...document.querySelectorAll(".card, .topbar > *, .transport > *")]
  .filter((node) => node.checkVisibility() && node.getBoundingClientRect().right > innerWidth)
  .map((node) => node.id || node.className)"""
"""Parts of the page that end beyond its right edge."""


def test_a_phone_shows_lead_acc_and_every_control(open_page: OpenPage, site: Site) -> None:
    page = open_page(390, 844)
    wait_for_frame(page, START)
    assert page.evaluate(OUTSIDE) == []
    for part in (".card.lead", ".card.acc", "[data-figure=ttc]", "#params-button", "#transport .record"):
        expect(page.locator(part)).to_be_in_viewport(ratio=1)
    assert page.evaluate(CUT, "[data-figure] .label") == []
    plan, tools = (page.locator(part).bounding_box() for part in ("#bev", "[aria-label='plan tools']"))
    assert plan is not None
    assert tools is not None
    assert plan["height"] > LEAST_PLAN * tools["height"]
