"""How fresh the page is: from a result made to its frame painted, in a real browser, and what painting costs it; and
how soon a changed parameter shows in the stream while the drive plays."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
from websockets.sync.client import connect

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
_PARAMETER_EVERY_S = 0.23
_PARAMETER_VALUES = (0.65, 0.75)
_REVISION = re.compile(rb'"params_revision":([0-9]+)')

_WATCH = """async () => {
  const { get, on } = await import("/js/store.js");
  window.paintedMs = [];
  const after = new MessageChannel();
  let made = null;
  // the message comes after the frame's style, layout and drawing: the painters' callbacks stand before this one
  after.port1.onmessage = () => {
    if (made !== null) window.paintedMs.push(performance.timeOrigin + performance.now() - made);
    made = null;
  };
  on(["frame"], () => {
    const { madeUnixMs } = get("frame");
    requestAnimationFrame(() => {
      made = madeUnixMs;
      after.port2.postMessage(0);
    });
  });
}"""


def figures(source: str, for_s: float) -> dict[str, Any]:
    """Milliseconds. ``page``: latency from result made to painted, and processor time a frame by kind of process;
    ``parameter``: from the request to the first message with its result. BadInput without a browser."""
    with _dashboard(source) as address:
        return {"source": source, "page": _page(address, for_s), "parameter": _parameter(address, for_s)}


@contextmanager
def _dashboard(source: str) -> Iterator[str]:
    """The address of a dashboard that plays, in a process of its own."""
    code = "import sys; from app.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "serve", source, "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        address = next((line.strip() for line in process.stdout if line.startswith("http")), None)
        if address is None:
            raise BadInput(f"{source} cannot be served")
        _wait_until_it_plays(address)
        yield address
    finally:
        process.terminate()
        process.communicate()


def _wait_until_it_plays(address: str) -> None:
    with connect(_stream(address), max_size=None) as socket:
        for message in socket:
            if isinstance(message, bytes):
                return


def _stream(address: str) -> str:
    return address.replace("http", "ws") + "/api/stream"


def _page(address: str, for_s: float) -> dict[str, Any]:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise BadInput("the page's bench needs the Python package playwright") from None
    if not CHROMIUM.exists():
        raise BadInput(f"the page's bench needs a browser at {CHROMIUM}")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = browser.new_page(viewport={"width": SIZE_PX[0], "height": SIZE_PX[1]})
        page.goto(address)
        page.wait_for_timeout(_SETTLE_S * 1e3)
        page.evaluate(_WATCH)
        processes = browser.new_browser_cdp_session()
        before, start = _cpu_s(processes), time.monotonic()
        page.wait_for_timeout(for_s * 1e3)
        painted_ms = page.evaluate("window.paintedMs")
        spent_s, after = time.monotonic() - start, _cpu_s(processes)
        browser.close()
    frames = max(1, len(painted_ms))
    cpu = {kind: round(1e3 * (after[kind] - before.get(kind, 0.0)) / frames, 1) for kind in after}
    return {
        **_spread(painted_ms),
        "frames": len(painted_ms),
        "rate_hz": round(len(painted_ms) / spent_s, 1),
        "cpu_ms_per_frame": {"all": round(sum(cpu.values()), 1), **{k: v for k, v in cpu.items() if v >= 1.0}},
    }


def _cpu_s(processes: Any) -> dict[str, float]:
    """Processor time of the browser so far, by kind of process."""
    spent: dict[str, float] = {}
    for process in processes.send("SystemInfo.getProcessInfo")["processInfo"]:
        spent[process["type"]] = spent.get(process["type"], 0.0) + process["cpuTime"]
    return spent


def _parameter(address: str, for_s: float) -> dict[str, Any]:
    """While the drive plays: one parameter, to and fro."""
    waits_ms: list[float] = []
    with connect(_stream(address), max_size=None, compression=None) as socket:
        end = time.monotonic() + for_s
        while time.monotonic() < end:
            value = _PARAMETER_VALUES[len(waits_ms) % 2]
            start = time.monotonic()
            revision = _change(address, {"cluster.tolerance_m": value})
            for message in socket:
                if isinstance(message, bytes) and _revision_of(message) >= revision:
                    break
            waits_ms.append((time.monotonic() - start) * 1e3)
            time.sleep(_PARAMETER_EVERY_S)
            _drop_waiting(socket)
    return {**_spread(waits_ms), "changes": len(waits_ms)}


def _change(address: str, changes: dict[str, float]) -> int:
    body = json.dumps({"changes": changes, "final": False}).encode()
    request = Request(f"{address}/api/params", body, {"content-type": "application/json"}, method="PATCH")
    with urlopen(request) as answer:
        return int(json.load(answer)["revision"])


def _revision_of(message: bytes) -> int:
    found = _REVISION.search(message)
    return int(found[1]) if found else -1


def _drop_waiting(socket: Any) -> None:
    """Forget what came while nobody waited for it."""
    while True:
        try:
            socket.recv(timeout=0)
        except TimeoutError:
            return


def _spread(values_ms: list[float]) -> dict[str, float | None]:
    if not values_ms:
        return {"median_ms": None, "p95_ms": None}
    return {
        "median_ms": round(float(np.median(values_ms)), 1),
        "p95_ms": round(float(np.percentile(values_ms, 95)), 1),
    }
