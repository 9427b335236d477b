"""Looking at a page, and putting a hand on it."""

from __future__ import annotations

import time

from playwright.sync_api import FloatRect, Locator, Page, expect

from tests.browser.conftest import WAIT_MS, Site

COUNT = 200
"""Frames of the scenario that the page shows."""
PLOT_LEFT_PX, PLOT_RIGHT_PX = 132, 8
"""Where the timeline's plot lies on its canvas."""


def frame_name(page: Page) -> str:
    return page.inner_text("#transport .name")


def wait_for_frame(page: Page, index: int) -> None:
    expect(page.locator("#transport .where .dim")).to_have_text(f"{index + 1}/{COUNT}", timeout=WAIT_MS)


def whole_drive(page: Page, site: Site) -> None:
    """Wait until the whole drive is computed, and is on the page's timeline: from then on no network runs."""
    site.engine.wait_for(lambda s: s.drive.done == s.drive.total == COUNT, WAIT_MS / 1e3)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")


def box_of(locator: Locator) -> FloatRect:
    box = locator.bounding_box()
    assert box is not None
    return box


def on_timeline(page: Page, index: int) -> float:
    """The pixel column of a frame's middle, on the timeline that shows everything."""
    width = box_of(page.locator("#timeline-front"))["width"] - PLOT_LEFT_PX - PLOT_RIGHT_PX
    return PLOT_LEFT_PX + width * (index + 0.5) / COUNT


def go_to(page: Page, index: int) -> None:
    """Press the timeline there, below its ribbon."""
    height = box_of(page.locator("#timeline-front"))["height"]
    page.locator("#timeline-front").click(position={"x": on_timeline(page, index), "y": height - 16})


_TWO_TURNS = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Of the screen: what was due has been drawn, and the words that follow it."""


def pixels(page: Page, canvas: str) -> str:
    """What is painted, once nothing more is to be painted."""
    page.evaluate(_TWO_TURNS)
    return page.evaluate(f"document.querySelector('{canvas}').toDataURL()")


def table(page: Page) -> str:
    """What the table of objects says, once also the rows out of sight say the shown frame's."""
    page.evaluate(_TWO_TURNS)
    body = page.locator("#objects tbody")
    expect(body).to_have_attribute("aria-busy", "false")
    said = body.text_content()
    assert said
    return said


def repainted(page: Page, canvas: str, old: str, *, like: bool = False) -> bool:
    """True as soon as a canvas shows something else than ``old``, or with ``like`` the same. One look a painted frame;
    the page's policy forbids playwright's own way of waiting, which evaluates text."""
    deadline = time.monotonic() + WAIT_MS / 1e3
    while time.monotonic() < deadline:
        if (pixels(page, canvas) == old) == like:
            return True
    return False


def colours(page: Page, canvas: str) -> int:
    """How many different colours a canvas shows: a blank one has one."""
    return page.evaluate(
        """(selector) => {
          const canvas = document.querySelector(selector);
          const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
          return new Set(new Uint32Array(data.buffer)).size;
        }""",
        canvas,
    )
