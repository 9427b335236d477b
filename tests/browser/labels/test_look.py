"""The labeling mode can be read and used, large and small, dark and light."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.judges import LOW_CONTRAST
from tests.browser.labels.hands import Labels, begin, draw
from tests.browser.looks import COUNT, box_of, pixels, wait_for_frame

SCREENS = Path(__file__).resolve().parents[3] / "build" / "screens"


pytestmark = pytest.mark.usefixtures("paused_in_traffic")


EXPORT = "#label-pane .pane-bar > button"


@pytest.mark.parametrize(("width", "height", "theme"), [(1440, 900, "light"), (1024, 600, "dark")])
def test_it_is_legible_and_fits(open_page: OpenPage, site: Site, width: int, height: int, theme: str):
    page = open_page(width, height, color_scheme=theme)
    labels = Labels(page, site.address)
    labels.clear(COUNT)
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
    for part in ("#label-bar", "#label-pane", "#label-keys", "#timeline-front", "#bev", "#camera", EXPORT):
        box = box_of(page.locator(part))
        assert box["x"] >= 0, part
        assert box["y"] >= 0, part
        assert box["x"] + box["width"] <= width, part
        assert box["y"] + box["height"] <= height, part


def nameless(page: Page) -> list[str]:
    """Controls without a name for screen readers."""
    return page.evaluate(
        """() => [...document.querySelectorAll("#label-bar button, #label-pane :is(button, select, input)")]
          .filter((node) => node.checkVisibility() && !(node.textContent.trim() || node.getAttribute("aria-label")))
          .map((node) => node.outerHTML)"""
    )
