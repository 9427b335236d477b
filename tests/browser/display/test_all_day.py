"""A day in the car leaves no trace in memory."""

from __future__ import annotations

from playwright.sync_api import Browser, CDPSession

from tests.app.recording import Recording
from tests.browser.conftest import Site
from tests.browser.display.conftest import WAIT_S, is_now

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
  const { on } = await import("/js/store.js");
  let came = () => {};
  if (!window.feeding) on(["frame"], () => window.feeding());
  for (let i = 0; i < count; i++) {
    const shown = new Promise((done) => (window.feeding = done));
    window.socket.onmessage({ data: window.newest.slice(0) });
    await shown;
    if (i % 5 === 0) await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  }
}"""
"""The newest message again and again, as the stream would bring it, painted every few times."""


def used_bytes(devtools: CDPSession) -> tuple[float, dict[str, int]]:
    devtools.send("HeapProfiler.collectGarbage")
    counters = devtools.send("Memory.getDOMCounters")
    return devtools.send("Runtime.getHeapUsage")["usedSize"], counters


def test_a_long_day_leaves_nothing_behind(browser: Browser, own: tuple[Site, Recording]):
    site, _ = own
    site.engine.wait_for(lambda s: s.tick is not None and s.tick.result.cipv is not None, WAIT_S)
    context = browser.new_context(viewport={"width": 800, "height": 480})
    context.add_init_script(KEEP_SOCKET)
    page = context.new_page()
    try:
        page.goto(f"{site.address}/drive/")
        is_now(page, "fresh")
        site.engine.control.change(playing=False)
        is_now(page, "paused")
        devtools = context.new_cdp_session(page)
        page.evaluate(FEED, 300)
        heap, counters = used_bytes(devtools)
        page.evaluate(FEED, 2000)
        later, counted = used_bytes(devtools)
    finally:
        context.close()
    assert later - heap < 500_000, "250 bytes a frame would be 100 MB in half a day"
    assert counted["nodes"] <= counters["nodes"] + 20
    assert counted["jsEventListeners"] <= counters["jsEventListeners"] + 5
