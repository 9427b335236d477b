"""Outdated content is covered at once, and a dead connection is replaced."""

from __future__ import annotations

import threading

import pytest
from playwright.sync_api import Browser, WebSocketRoute, expect

from pipeline.types import U8, RawBoxes
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.browser.conftest import Site
from tests.browser.display.conftest import OpenDisplay, is_now, keep

LOOKS = 200
"""The page is looked at every 5 ms, and covers itself within 50. A busy machine delays both, so turns are counted, not
milliseconds, with much to spare: on two busy cores it was 63."""

WATCH = """async (looks) => {
  const { get } = await import("/js/core/store.js");
  const { serverNow } = await import("/js/core/connection.js");
  const { mayBeMs } = await import("/drive/freshness.js");
  window.seen = { fresh: 0, covered: 0 };
  const cover = document.querySelector("#cover");
  const look = () => {
    const beyond = serverNow() - get("frame").madeUnixMs - mayBeMs(get("state"));
    const kind = cover.checkVisibility() && cover.dataset.kind !== "paused" ? "covered" : "fresh";
    if (beyond > 0) window.seen[kind] += 1;
    document.body.dataset.wasLate = window.seen.covered > looks;
  };
  setInterval(look, 5);
}"""
"""How often a frame beyond its age, by the page's own clock, was seen as fresh, and how often covered."""

ENDS = {"the line stands still": "stale", "the server is gone": "lost"}


@pytest.mark.parametrize("how", ENDS)
def test_what_is_too_old_is_covered_at_once_and_comes_back(
    open_display: OpenDisplay, own: tuple[Site, Recording], how: str
):
    site, recording = own
    page = open_display(site.address, quiet=ENDS[how] == "stale")
    is_now(page, "fresh")
    expect(page.locator("#distance")).not_to_have_text("–")
    page.evaluate(WATCH, LOOKS)
    if ENDS[how] == "stale":
        recording.gate.clear()
    else:
        site.stop()
    is_now(page, ENDS[how])
    expect(page.locator("#cover")).to_be_visible()
    for figure in ("#distance", "#closing", "#acc-word", "#ttc-value", "#road", "#plan", "#sensors"):
        expect(page.locator(figure)).to_be_hidden()
    expect(page.locator("body")).to_have_attribute("data-was-late", "true")
    assert page.evaluate("window.seen.fresh") <= LOOKS
    keep(page, f"drive_{ENDS[how]}")
    if ENDS[how] == "stale":
        recording.gate.set()
    else:
        page.locator("#mark").tap()
        expect(page.locator("#answer")).to_have_text("✕ Mark failed: no connection")
        site.start()
    is_now(page, "fresh")
    expect(page.locator("#distance")).to_be_visible()


class SlowNetwork(CountingDetector):
    """Takes longer for an image than the display lets a frame grow old."""

    def detect(self, bgr: U8) -> RawBoxes:
        threading.Event().wait(0.6)
        return super().detect(bgr)


@pytest.mark.parametrize("detector", [SlowNetwork()])
def test_a_computer_that_is_too_slow_is_said_to_be(open_display: OpenDisplay, own: tuple[Site, Recording]):
    page = open_display(own[0].address)
    expect(page.locator("#cover-why")).to_contain_text("results are late: this computer is too slow")
    keep(page, "drive_too_slow")


def test_a_paused_recording_is_not_old_but_says_so(open_display: OpenDisplay, own: tuple[Site, Recording]):
    site, _ = own
    page = open_display(site.address)
    is_now(page, "fresh")
    site.engine.control.change(playing=False)
    is_now(page, "paused")
    expect(page.locator("#cover")).to_contain_text("PAUSED")
    expect(page.locator("#distance")).to_be_visible()
    page.reload()
    is_now(page, "paused")
    site.engine.control.change(playing=True)
    is_now(page, "fresh")


def test_a_connection_that_says_nothing_any_more_is_left_for_another(browser: Browser, own: tuple[Site, Recording]):
    """As when a cable is unplugged: to the system, the connection stays open for ever."""
    site, _ = own
    context = browser.new_context()
    page = context.new_page()
    opened: list[WebSocketRoute] = []

    def silent_at_first(route: WebSocketRoute) -> None:
        opened.append(route)
        if len(opened) > 1:
            route.connect_to_server()

    try:
        page.route_web_socket("**/api/stream**", silent_at_first)
        page.clock.install()
        page.goto(f"{site.address}/drive/")
        is_now(page, "waiting")
        for _ in range(5):
            page.clock.run_for(2000)  # one ping of the page each
        expect(page.locator("#distance")).not_to_have_text("–")
        assert len(opened) == 2
    finally:
        context.close()
