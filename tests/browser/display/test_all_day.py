"""A day in the car leaves no trace in memory."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, CDPSession, Page

from tests.app.engine.recording_helpers import Recording
from tests.browser.conftest import Site
from tests.browser.display.conftest import WAIT_S, is_now

HOURS, FRAMES_AN_HOUR, SLICE = 24, 36_000, 3_000

KEEP_SOCKET = """
const Real = WebSocket;
window.WebSocket = class extends Real {
  constructor(...given) {
    super(...given);
    window.socket = this;
    this.addEventListener("message", ({ data }) => { if (typeof data !== "string") window.newest = data; });
  }
};
"""
FEED = """async (count) => {
  const { on } = await import("/js/core/store.js");
  let came = () => {};
  if (!window.feeding) on(["frame"], () => window.feeding());
  for (let i = 0; i < count; i++) {
    const shown = new Promise((done) => (window.feeding = done));
    window.socket.onmessage({ data: window.newest.slice(0) });
    await shown;
    if (i % 5 === 0) await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  }
}"""
"""Deliver the newest message repeatedly, as the stream would; the page paints every few of them."""


def used_bytes(devtools: CDPSession) -> tuple[float, dict[str, int]]:
    devtools.send("HeapProfiler.collectGarbage")
    counters = devtools.send("Memory.getDOMCounters")
    return devtools.send("Runtime.getHeapUsage")["usedSize"], counters


@pytest.fixture
def fed(browser: Browser, own: tuple[Site, Recording]) -> Iterator[Page]:
    """The display on a paused recording with a lead, ready to be fed."""
    site, _ = own
    site.engine.wait_for(lambda s: s.processed is not None and s.processed.result.cipv is not None, WAIT_S)
    context = browser.new_context(viewport={"width": 800, "height": 480})
    context.add_init_script(KEEP_SOCKET)
    page = context.new_page()
    page.goto(f"{site.address}/drive/")
    is_now(page, "fresh")
    site.engine.control.change(playing=False)
    is_now(page, "paused")
    yield page
    context.close()


def test_a_long_day_leaves_nothing_behind(fed: Page):
    devtools = fed.context.new_cdp_session(fed)
    fed.evaluate(FEED, 300)
    heap, counters = used_bytes(devtools)
    fed.evaluate(FEED, 2000)
    later, counted = used_bytes(devtools)
    assert later - heap < 500_000, "250 bytes a frame would be 100 MB in half a day"
    assert counted["nodes"] <= counters["nodes"] + 20
    assert counted["jsEventListeners"] <= counters["jsEventListeners"] + 5


@pytest.mark.soak
@pytest.mark.timeout(4 * 3600)
def test_a_whole_day_of_frames_leaves_nothing_behind(fed: Page):
    """As many frames as in a day at ten per second, each drawn or skipped as on a page in the car."""
    devtools, used = fed.context.new_cdp_session(fed), []
    for hour in range(HOURS):
        for _ in range(FRAMES_AN_HOUR // SLICE):
            fed.evaluate(FEED, SLICE)
        used.append(used_bytes(devtools))
        print(f"hour {hour + 1}: heap {used[-1][0] / 1e6:.2f} MB, {used[-1][1]['nodes']} nodes", flush=True)
    (first, at_first), (last, at_last) = used[0], used[-1]
    assert last - first < 2_000_000, [round(heap / 1e6, 1) for heap, _ in used]
    assert at_last["nodes"] <= at_first["nodes"] + 20
    assert at_last["jsEventListeners"] <= at_first["jsEventListeners"] + 5
