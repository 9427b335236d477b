"""Measures the dashboard in a real browser: what is painted, how soon, and at what cost. The page itself measures all
times, from a navigation, the creation of a frame or a user action to the message that follows the paint of the
frame."""

from __future__ import annotations

import time
from typing import NamedTuple

from app.bench.page.devtools import Browser, BrowserPage

_SETTLE_S = 4.0
_FIRST_VIEWS = 5
_SEEKS = 24
_SLIDES = 24
_FAR = 37
"""Number of frames between one seek and the next, modulo the length of the recording. A prime, so that nearly all
frames are visited."""
_PARAMETER = "cluster.tolerance_m"
_ACT_PAUSE_MS, _PATIENCE_MS = 120, 30_000

_WATCH = """
window.painted = [];
const { get, on } = await import("/js/core/store.js");
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
  const { seekTo } = await import("/js/drive/seek.js"), { get } = await import("/js/core/store.js");
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
    """Milliseconds from a user action until the camera image, the bird's-eye view, the lead's figures and the timeline
    cursor show the outcome; and until the table, the reasons and the parameters do, one screen refresh later."""

    painted_ms: float
    """Until image, bird's-eye view, figures and cursor show the outcome."""
    whole_ms: float
    """Until table, reasons and parameters show it too."""


def first_views_ms(running: Browser, address: str) -> list[float]:
    """Milliseconds from opening the address to the first painted frame, each time with an empty cache."""
    found = []
    for _ in range(_FIRST_VIEWS):
        page = opened(running, address)
        found.append(page.call("() => window.painted[0].at"))
        page.close()
    return found


def opened(running: Browser, address: str) -> BrowserPage:
    """The dashboard in a fresh profile, after its first painted frame."""
    page = running.open(address, f"(async () => {{ {_WATCH} }})()")
    page.call(_ONE_PAINTED, _PATIENCE_MS)
    return page


def playing(running: Browser, address: str, for_s: float) -> tuple[list[float], float, dict[str, float]]:
    """Figures during playback: milliseconds from the creation of each result to its painted frame, frames per second,
    and the browser's CPU time in ms per frame by kind of process."""
    page = opened(running, address)
    time.sleep(_SETTLE_S)
    page.call("() => { window.painted = []; }")
    before, start = running.cpu_s(), time.monotonic()
    time.sleep(for_s)
    painted_ms: list[float] = page.call("() => window.painted.map(({ ms }) => ms)")
    spent_s, after = time.monotonic() - start, running.cpu_s()
    page.close()
    frames = max(1, len(painted_ms))
    cpu = {kind: round(1e3 * (after[kind] - before.get(kind, 0.0)) / frames, 1) for kind in after}
    return painted_ms, len(painted_ms) / spent_s, cpu


def paused(running: Browser, address: str, count: int, settle_s: float = _SETTLE_S) -> tuple[list[Waits], list[Waits]]:
    """Delays after each seek and each slider move on a paused recording of ``count`` frames, with a page that was
    opened ``settle_s`` ago."""
    page = opened(running, address)
    time.sleep(settle_s)
    seeks = [{"seek": (_FAR * (n + 1)) % count} for n in range(_SEEKS)] if count > 1 else []
    slides = [{"param": _PARAMETER, "value": str(0.6 + 0.02 * (n % 7))} for n in range(_SLIDES)]
    first, second = (page.call(_ACT, [acts, _ACT_PAUSE_MS, _PATIENCE_MS]) for acts in (seeks, slides))
    page.close()
    return [Waits(*each) for each in first], [Waits(*each) for each in second]
