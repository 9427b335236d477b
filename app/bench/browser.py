"""The dashboard in a real browser, timed there: what is painted, how soon, and what it costs.

All times are the page's own: from a navigation, a frame made, or a hand's act, until the message that follows the
painting of the frame that shows it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from pipeline.errors import BadInput

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
"""As a browser starts by itself where there is no graphics card: the page is composed by the processor, and WebGL
is there for the 3D views."""
SIZE_PX = (1440, 900)
_SETTLE_S = 4.0
_FIRST_VIEWS = 5
_SEEKS = 24
_SLIDES = 24
_FAR = 37
"""Frames from one seek to the next, around the recording: coprime with most lengths, so nearly all are visited."""
_PARAMETER = "cluster.tolerance_m"
_ACT_PAUSE_MS, _PATIENCE_MS = 120, 30_000

_WATCH = """
window.painted = [];
const { get, on } = await import("/js/store.js");
const after = new MessageChannel();
let shown = null;
// the message comes after the frame's style, layout and drawing: the painters' callbacks stand before this one
after.port1.onmessage = () => {
  const { state, madeUnixMs } = shown ?? {};
  if (!shown) return;
  shown = null;
  const at = performance.now(), ms = performance.timeOrigin + at - madeUnixMs;
  window.painted.push({ ms, at, index: state.index, params: state.params_revision });
  window.onpainted?.();
};
const follow = () => {
  const frame = get("frame");
  requestAnimationFrame(() => {
    shown = frame;
    after.port2.postMessage(0);
  });
};
on(["frame"], follow);
if (get("frame")) follow();
"""
_ONE_PAINTED = """(patience) => new Promise((done, fail) => {
  setTimeout(() => fail(new Error("no frame was painted")), patience);
  if (window.painted?.length) done();
  else window.onpainted = done;
})"""
_ACT = """async ([acts, pause, patience]) => {
  const { seekTo } = await import("/js/drive/seek.js"), { get } = await import("/js/store.js");
  const waits = [];
  const until = (holds) => new Promise((done, fail) => {
    setTimeout(() => fail(new Error("what was asked for was not painted")), patience);
    window.onpainted = () => holds(window.painted.at(-1)) && done();
  });
  for (const act of acts) {
    const start = performance.now(), before = get("state").params_revision;
    const seen = until((last) => ("seek" in act ? last.index === act.seek : last.params > before));
    if ("seek" in act) seekTo(act.seek);
    else {
      const range = document.querySelector(`[data-param='${act.param}'] input[type=range]`);
      range.value = act.value;
      range.dispatchEvent(new Event("input", { bubbles: true }));
    }
    await seen;
    const painted = performance.now() - start;
    await new Promise((done) => {
      const after = new MessageChannel();
      after.port1.onmessage = done;
      requestAnimationFrame(() => after.port2.postMessage(0));
    });
    waits.push([painted, performance.now() - start]);
    await new Promise((done) => setTimeout(done, pause));
  }
  return waits;
}"""


class Waits(NamedTuple):
    """Milliseconds from a hand's act: until camera, plan, the lead's figures and the timeline's cursor are painted with
    what comes of it; and until the table, the reasons and the parameters are too, one turn of the screen later."""

    painted_ms: float
    whole_ms: float


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium without a window. BadInput where it is missing."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise BadInput("the page's bench needs the Python package playwright") from None
    if not CHROMIUM.exists():
        raise BadInput(f"the page's bench needs a browser at {CHROMIUM}")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        try:
            yield running
        finally:
            running.close()


def first_views_ms(running: Any, address: str) -> list[float]:
    """From opening the address to the first frame painted, each with nothing kept from before."""
    found = []
    for _ in range(_FIRST_VIEWS):
        page = opened(running, address)
        found.append(page.evaluate("() => window.painted[0].at"))
        page.context.close()
    return found


def opened(running: Any, address: str) -> Any:
    """The dashboard in a fresh profile, once it has painted a frame."""
    page = running.new_page(viewport={"width": SIZE_PX[0], "height": SIZE_PX[1]})
    page.add_init_script(f"(async () => {{ {_WATCH} }})()")
    page.goto(address)
    page.evaluate(_ONE_PAINTED, _PATIENCE_MS)
    return page


def playing(running: Any, address: str, for_s: float) -> tuple[list[float], float, dict[str, float]]:
    """Of each frame painted while it plays: milliseconds from the result made. Frames a second; and the browser's
    processor time in milliseconds a frame, by kind of process."""
    page = opened(running, address)
    page.wait_for_timeout(_SETTLE_S * 1e3)
    page.evaluate("() => { window.painted = []; }")
    processes = running.new_browser_cdp_session()
    before, start = _cpu_s(processes), time.monotonic()
    page.wait_for_timeout(for_s * 1e3)
    painted_ms = page.evaluate("() => window.painted.map(({ ms }) => ms)")
    spent_s, after = time.monotonic() - start, _cpu_s(processes)
    page.context.close()
    frames = max(1, len(painted_ms))
    cpu = {kind: round(1e3 * (after[kind] - before.get(kind, 0.0)) / frames, 1) for kind in after}
    return painted_ms, len(painted_ms) / spent_s, cpu


def paused(running: Any, address: str, count: int) -> tuple[list[Waits], list[Waits]]:
    """On a recording of ``count`` frames that is paused: how long after each seek, and each of a slider's moves."""
    page = opened(running, address)
    page.wait_for_timeout(_SETTLE_S * 1e3)
    seeks = [{"seek": (_FAR * (n + 1)) % count} for n in range(_SEEKS)] if count > 1 else []
    slides = [{"param": _PARAMETER, "value": str(0.6 + 0.02 * (n % 7))} for n in range(_SLIDES)]
    found = [page.evaluate(_ACT, [acts, _ACT_PAUSE_MS, _PATIENCE_MS]) for acts in (seeks, slides)]
    page.context.close()
    first, second = ([Waits(*each) for each in waits] for waits in found)
    return first, second


def _cpu_s(processes: Any) -> dict[str, float]:
    """Processor time of the browser so far, by kind of process."""
    spent: dict[str, float] = {}
    for process in processes.send("SystemInfo.getProcessInfo")["processInfo"]:
        spent[process["type"]] = spent.get(process["type"], 0.0) + process["cpuTime"]
    return spent
