"""Reads a page's state and operates its controls."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

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


def settle(page: Page) -> None:
    """Wait until what is to be drawn now is drawn."""
    page.evaluate(_TWO_TURNS)


_DIGEST = """async ([selector, pauseMs]) => {
  if (pauseMs) await new Promise((done) => setTimeout(done, pauseMs));
  for (let turn = 0; turn < 2; turn++) await new Promise(requestAnimationFrame);
  const image = new TextEncoder().encode(document.querySelector(selector).toDataURL());
  return [...new Uint8Array(await crypto.subtle.digest("SHA-256", image))].join(" ");
}"""
"""After as many screen refreshes. The image itself is megabytes of text, which two processes would parse."""


def pixels(page: Page, canvas: str, pause_ms: float = 0.0) -> str:
    """A digest of the canvas's content, once nothing more is to be painted."""
    return page.evaluate(_DIGEST, [canvas, pause_ms])


def table(page: Page) -> str:
    """The text of the objects table, once the rows out of sight show the current frame too."""
    settle(page)
    body = page.locator("#objects tbody")
    expect(body).to_have_attribute("aria-busy", "false")
    said = body.text_content()
    assert said
    return said


def repainted(page: Page, canvas: str, old: str, *, like: bool = False) -> bool:
    """True once the canvas differs from ``old``, or equals it with ``like``. Checked after a painted frame, less and
    less often, since encoding an image takes from what is waited for. The page's policy forbids Playwright's own
    waiting, which evaluates text."""
    return any((pixels(page, canvas, pause_ms) == old) == like for pause_ms in pauses())


def pauses() -> Iterator[float]:
    """Milliseconds to wait before looking again, until ``WAIT_MS`` have passed: 0, 20, 40 … 320, 320."""
    deadline, pause_ms = time.monotonic() + WAIT_MS / 1e3, 0.0
    while time.monotonic() < deadline:
        yield pause_ms
        pause_ms = min(max(2 * pause_ms, 20.0), 320.0)


_SHOW_INSTEAD = """async (wanted) => {
  const { get, on, set } = await import("/js/core/store.js");
  const isPart = (part) => part !== null && typeof part === "object" && !Array.isArray(part);
  const changed = (now, part) => {
    if (!isPart(part)) return part;
    const parts = Object.entries(part).map(([key, value]) => [key, changed(now?.[key], value)]);
    return { ...now, ...Object.fromEntries(parts) };
  };
  const differs = (now, part) =>
    isPart(part)
      ? Object.keys(part).some((k) => differs(now?.[k], part[k]))
      : JSON.stringify(now) !== JSON.stringify(part);
  const hold = () => {
    for (const [key, part] of Object.entries(window.wanted))
      if (differs(get(key), part)) set(key, changed(get(key), part));
  };
  if (!window.wanted) on(["state", "frame"], hold);
  window.wanted = wanted;
  hold();
}"""


def show_instead(page: Page, **parts: dict[str, Any]) -> None:
    """Change parts of the page's ``state`` and ``frame``, as the server would, until the next call. What the server
    sends meanwhile, at whatever time, is changed likewise."""
    page.evaluate(_SHOW_INSTEAD, parts)


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
