"""Reads a page's state and operates its controls."""

from __future__ import annotations

import time

from playwright.sync_api import FloatRect, Locator, Page, expect

from tests.browser.conftest import WAIT_MS, Site

COUNT = 200
"""Number of frames of the scenario that the page shows."""
PLOT_LEFT_PX, PLOT_RIGHT_PX = 132, 8
"""Margins of the timeline's plot on its canvas."""


def frame_name(page: Page) -> str:
    return page.inner_text("#transport .name")


def wait_for_frame(page: Page, index: int) -> None:
    expect(page.locator("#transport .where .dim")).to_have_text(f"{index + 1}/{COUNT}", timeout=WAIT_MS)


def whole_drive(page: Page, site: Site) -> None:
    """Wait until the whole drive is computed and on the page's timeline. From then on, no network runs."""
    site.engine.wait_for(lambda s: s.drive.done == s.drive.total == COUNT, WAIT_MS / 1e3)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")


def box_of(locator: Locator) -> FloatRect:
    box = locator.bounding_box()
    assert box is not None
    return box


def on_timeline(page: Page, index: int) -> float:
    """The pixel column of a frame's middle on the timeline, zoomed out completely."""
    width = box_of(page.locator("#timeline-front"))["width"] - PLOT_LEFT_PX - PLOT_RIGHT_PX
    return PLOT_LEFT_PX + width * (index + 0.5) / COUNT


def go_to(page: Page, index: int) -> None:
    """Click the timeline at this frame, below its ribbon."""
    height = box_of(page.locator("#timeline-front"))["height"]
    page.locator("#timeline-front").click(position={"x": on_timeline(page, index), "y": height - 16})


_TWO_TURNS = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Two screen refreshes: pending drawing is done, and so are the texts that follow it."""


def pixels(page: Page, canvas: str) -> str:
    """The canvas's content, once nothing more is to be painted."""
    page.evaluate(_TWO_TURNS)
    return page.evaluate(f"document.querySelector('{canvas}').toDataURL()")


def table(page: Page) -> str:
    """The text of the objects table, once the rows out of sight show the current frame too."""
    page.evaluate(_TWO_TURNS)
    body = page.locator("#objects tbody")
    expect(body).to_have_attribute("aria-busy", "false")
    said = body.text_content()
    assert said
    return said


def repainted(page: Page, canvas: str, old: str, *, like: bool = False) -> bool:
    """True once the canvas differs from ``old``, or equals it with ``like``. Checked once per painted frame, since the
    page's policy forbids Playwright's own waiting, which evaluates text."""
    deadline = time.monotonic() + WAIT_MS / 1e3
    while time.monotonic() < deadline:
        if (pixels(page, canvas) == old) == like:
            return True
    return False


def colours(page: Page, canvas: str) -> int:
    """Number of different colours on a canvas; a blank one has one."""
    return page.evaluate(
        """(selector) => {
          const canvas = document.querySelector(selector);
          const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
          return new Set(new Uint32Array(data.buffer)).size;
        }""",
        canvas,
    )
