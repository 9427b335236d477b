"""Headless Chromium, driven by its DevTools protocol (https://chromedevtools.github.io/devtools-protocol).

This module only runs scripts in pages. Browser test tools also intercept all requests, so every message of the stream
is encoded again for the tool. That costs 10 ms or more per frame on two cores, a cost that real users do not have.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import connect
from websockets.sync.connection import Connection

from pipeline.common.errors import BadInput

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
"""These are the browser's own defaults on a machine without a GPU: the CPU composites the page, and WebGL is available
for the 3D views."""
SIZE_PX = (1440, 900)
_STARTS_WITHIN_S, _LOOK_EVERY_S, _ANSWERS_WITHIN_S = 30.0, 0.05, 120.0


@contextmanager
def browser() -> Iterator[Browser]:
    """Chromium with its own profile. BadInput when it is missing or does not start."""
    if not CHROMIUM.exists():
        raise BadInput(f"the page benchmark needs a browser at {CHROMIUM}")
    with tempfile.TemporaryDirectory(prefix="cipv-browser-", ignore_cleanup_errors=True) as profile:
        command = [str(CHROMIUM), "--headless", "--remote-debugging-port=0", f"--user-data-dir={profile}", *FLAGS]
        running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            with connect(_address(Path(profile), running), max_size=None, proxy=None) as socket:
                yield Browser(socket)
        finally:
            running.terminate()
            running.wait()


def _address(profile: Path, running: subprocess.Popen[bytes]) -> str:
    """The address that the browser listens on, which it writes to its profile."""
    said, deadline = profile / "DevToolsActivePort", time.monotonic() + _STARTS_WITHIN_S
    while time.monotonic() < deadline and running.poll() is None:
        port, _, path = said.read_text().partition("\n") if said.exists() else ("", "", "")
        if path:
            return f"ws://127.0.0.1:{port}{path.strip()}"
        time.sleep(_LOOK_EVERY_S)
    raise BadInput(f"{CHROMIUM} does not start")


class Browser:
    """A running browser."""

    def __init__(self, socket: Connection) -> None:
        self._socket = socket
        self._asked = 0
        self._told: set[tuple[str, str]] = set()

    def ask(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """Send a command and return its result. BadInput if the browser refuses it or does not answer."""
        self._asked += 1
        command = {"id": self._asked, "method": method, "params": params} | ({"sessionId": session} if session else {})
        self._socket.send(json.dumps(command))
        while (answer := self._heard(method)).get("id") != self._asked:
            pass
        if "error" in answer:
            raise BadInput(f"the browser refuses {method}: {answer['error']['message']}")
        return dict(answer["result"])

    def wait_for(self, event: str, session: str) -> None:
        """Wait until the browser reports an event; return at once if it already has."""
        while (event, session) not in self._told:
            self._heard(event)

    def _heard(self, waiting_for: str) -> dict[str, Any]:
        try:
            said: dict[str, Any] = json.loads(self._socket.recv(timeout=_ANSWERS_WITHIN_S))
        except TimeoutError:
            raise BadInput(f"the browser does not respond to {waiting_for}") from None
        if "method" in said:
            self._told.add((said["method"], said.get("sessionId", "")))
        return said

    def open(self, address: str, first: str = "") -> BrowserPage:
        """Load a page with an empty cache. first: a script that runs before the page's own scripts."""
        context = self.ask("Target.createBrowserContext")["browserContextId"]
        width, height = SIZE_PX
        target = self.ask("Target.createTarget", url="about:blank", browserContextId=context)["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.ask("Emulation.setDeviceMetricsOverride", session, **size)
        self.ask("Page.enable", session)
        self.ask("Page.addScriptToEvaluateOnNewDocument", session, source=first)
        self.ask("Page.navigate", session, url=address)
        self.wait_for("Page.loadEventFired", session)
        return BrowserPage(self, context, session)

    def cpu_s(self) -> dict[str, float]:
        """CPU time so far, by kind of process."""
        spent: dict[str, float] = {}
        for process in self.ask("SystemInfo.getProcessInfo")["processInfo"]:
            spent[process["type"]] = spent.get(process["type"], 0.0) + process["cpuTime"]
        return spent


class BrowserPage:
    """An open page."""

    def __init__(self, browser: Browser, context: str, session: str) -> None:
        self._browser, self._context, self._session = browser, context, session

    def call(self, function: str, *given: Any) -> Any:
        """Call a JavaScript function and return its value, or that of its promise. BadInput with its message if it
        throws."""
        script = f"({function})({', '.join(map(json.dumps, given))})"
        wanted = {"expression": script, "awaitPromise": True, "returnByValue": True}
        answer = self._browser.ask("Runtime.evaluate", self._session, **wanted)
        if thrown := answer.get("exceptionDetails"):
            raise BadInput(f"the page: {thrown.get('exception', {}).get('description', thrown['text'])}")
        return answer["result"].get("value")

    def close(self) -> None:
        """Close the page and discard its storage."""
        self._browser.ask("Target.disposeBrowserContext", browserContextId=self._context)
