"""The labeling mode can be read and used, large and small, dark and light."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.labels.store.values import LONGEST_NAME
from tests.browser.conftest import START, OpenPage, Site
from tests.browser.judges import LOW_CONTRAST
from tests.browser.labels.hands import Labels, begin, draw
from tests.browser.looks import COUNT, box_of, pixels, settle, wait_for_frame

SCREENS = Path(__file__).resolve().parents[3] / "build" / "screens"


pytestmark = pytest.mark.usefixtures("paused_in_traffic")


EXPORT = "#label-pane .pane-bar > button"


VEHICLES = 30


def crowd(labels: Labels) -> None:
    """Vehicles in three lanes, the left one oncoming, in the shown frame."""
    for number in range(VEHICLES):
        row, lane = divmod(number, 3)
        center = [8.0 + 6.5 * row, 3.5 * (1 - lane), 0.8]
        shape = {"center": center, "size": [4.3, 1.8, 1.5], "yaw_rad": math.pi if lane == 0 else 0.0}
        label = ("car", "truck", "bus")[row % 3]
        labels.act("Bob", {"kind": "add_track", "frame": START, "label": label, "cuboid": shape})


@pytest.mark.parametrize(
    ("width", "height", "theme"), [(1440, 900, "light"), (1440, 900, "dark"), (1280, 720, "light"), (1024, 600, "dark")]
)
def test_it_is_legible_and_fits(open_page: OpenPage, site: Site, width: int, height: int, theme: str):
    page = open_page(width, height, color_scheme=theme)
    labels = Labels(page, site.address)
    labels.clear(COUNT)
    crowd(labels)
    wait_for_frame(page, START)
    draw(begin(page), labels)
    pixels(page, "#timeline-back")
    said = page.locator(".said")
    expect(said).to_contain_text(f"in frame {START + 1}")
    assert said.evaluate("(node) => node.scrollWidth <= node.clientWidth && node.clientHeight > 0"), "all of it is read"
    assert box_of(said)["width"] >= 200, "and what is longer, too"
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / f"labeling_{width}_{theme}.png")
    assert page.evaluate(LOW_CONTRAST) == []
    assert nameless(page) == []
    page.evaluate("document.querySelector('#vitals dd').textContent = '1234567890123'")
    for button in page.locator(".topbar .icon-button:visible").all():
        assert box_of(button)["width"] >= 24, "however long the figures beside it are"
    for part in ("#label-bar", "#label-pane", "#label-keys", "#timeline-front", "#bev", "#camera", EXPORT):
        box = box_of(page.locator(part))
        assert box["x"] >= 0, part
        assert box["y"] >= 0, part
        assert box["x"] + box["width"] <= width, part
        assert box["y"] + box["height"] <= height, part
    page.locator(EXPORT).click()
    menu = page.locator("#menu")
    expect(menu.locator(".losses li").first).to_be_attached()  # the entries come after the menu is shown
    settle(page)
    box = box_of(menu)
    assert box["x"] + box["width"] <= width
    assert box["y"] + box["height"] <= height
    page.keyboard.press("Escape")


def test_the_labels_panel_stays_when_the_window_becomes_small(open_page: OpenPage, site: Site):
    page = open_page(1440, 900)
    Labels(page, site.address).clear(COUNT)
    begin(page)
    page.set_viewport_size({"width": 1024, "height": 768})
    expect(page.locator("#label-pane")).to_be_in_viewport()
    box = box_of(page.locator("#label-pane"))
    assert box["x"] + box["width"] <= 1024
    page.set_viewport_size({"width": 720, "height": 450})
    tabs = page.locator("#label-pane [role=tab]")
    expect(tabs.first).to_be_in_viewport(ratio=1)
    assert tabs.evaluate_all("all => all.filter((tab) => tab.scrollWidth > tab.clientWidth).length") == 0, "cut words"
    page.keyboard.press("Shift+L")
    expect(page.locator("#label-pane")).to_be_hidden()
    expect(page.locator(".side-column")).to_be_hidden()  # it would cover the views


def test_a_name_is_no_longer_than_the_server_takes_and_leaves_the_bar_its_room(open_page: OpenPage):
    page = open_page(1280, 720, locale="en")  # a locale: a page of its own, whose person is not known
    page.evaluate("localStorage.removeItem('cipv.person')")
    expect(page.locator("#label-button")).to_be_enabled()
    page.keyboard.press("Shift+L")
    shown = page.locator(".annotator")
    expect(shown).to_have_text("your name")  # the labels are there: nothing else makes the bar paint again
    page.get_by_role("textbox", name="Name", exact=True).press_sequentially("A" * (LONGEST_NAME + 9))
    page.keyboard.press("Enter")
    page.wait_for_function("() => localStorage.getItem('cipv.person')")
    settle(page)
    assert shown.inner_text() == "A" * LONGEST_NAME, "it is shown at once"
    assert box_of(page.locator(".annotator"))["width"] <= 150
    page.evaluate("localStorage.removeItem('cipv.person')")


def test_name_tags_cover_no_vehicle_and_those_without_room_are_left_out(open_page: OpenPage):
    """As bounds [left, top, right, bottom] of what is painted."""
    page = open_page()
    painted = page.evaluate(
        """async () => {
          const { Labels } = await import("/js/views/drawing/text_labels.js");
          const canvas = new OffscreenCanvas(300, 200), ctx = canvas.getContext("2d", { willReadFrequently: true });
          const painted = (weight, vehicles, end, bottom) => {
            ctx.clearRect(0, 0, 300, 200);
            const tags = new Labels(ctx, 300, 0, bottom);
            for (const each of vehicles) tags.keepFree(...each);
            tags.put("#7", 120, 100, "#fff", weight, end);
            const { data } = ctx.getImageData(0, 0, 300, 200), xs = [], ys = [];
            for (let i = 0; i < 300 * 200; i++) if (data[4 * i + 3]) { xs.push(i % 300); ys.push(Math.floor(i / 300)); }
            return xs.length ? [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)] : null;
          };
          const right = [110, 0, 190, 200], left = [0, 0, 100, 200];
          return [painted("weak", [], 90), painted("weak", [right], 90), painted("weak", [left, right], 90),
            painted("must", [left, right], 90), painted("strong", [[0, 0, 300, 400]], undefined, 200)];
        }"""
    )
    free, moved, left_out, always, crowded = painted
    assert free[0] >= 120
    assert moved[2] <= 90, "to the other side"
    assert left_out is None
    assert always is not None
    assert crowded is not None, "the lead's is in the image, and be it on a vehicle"


def nameless(page: Page) -> list[str]:
    """Controls without a name for screen readers."""
    return page.evaluate(
        """() => [...document.querySelectorAll("#label-bar button, #label-pane :is(button, select, input)")]
          .filter((node) => node.checkVisibility() && !(node.textContent.trim() || node.getAttribute("aria-label")))
          .map((node) => node.outerHTML)"""
    )
