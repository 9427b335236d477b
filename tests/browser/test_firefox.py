"""The dashboard in Firefox, where it is installed: Playwright's own Firefox is not what people use."""

from __future__ import annotations

import itertools
import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from tests.browser.conftest import START, Site

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
WAIT_S = 120.0
READY = "WebDriver BiDi listening on "
PREFERENCES = {
    "browser.shell.checkDefaultBrowser": False,
    "browser.startup.page": 0,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
}
"""Nothing but the page is to be loaded."""
SEEN = """new Promise(requestAnimationFrame).then(() => {
  const seen = (id) => {
    const canvas = document.querySelector(id), { width, height } = canvas;
    return new Set(new Uint32Array(canvas.getContext("2d").getImageData(0, 0, width, height).data.buffer)).size;
  };
  return JSON.stringify({
    frame: Number(document.querySelector("#timeline-front").getAttribute("aria-valuenow")),
    rows: document.querySelectorAll("#objects tbody tr").length,
    gates: document.querySelectorAll("#why .gate").length,
    camera: seen("#camera"), plan: seen("#bev"), timeline: seen("#timeline-back"),
    link: document.querySelector("#link").textContent,
  });
})"""
"""What the page shows at its next refresh; of the canvases, the number of colours, which is 1 if nothing is drawn."""

pytestmark = pytest.mark.skipif(FIREFOX is None, reason="no Firefox: the page is looked at in Chromium only")


class Tab:
    """A page of Firefox, over WebDriver BiDi (https://w3c.github.io/webdriver-bidi/)."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection, self._numbers = connection, itertools.count()
        self.complaints: list[str] = []
        """Errors and warnings in its console."""
        self.ask("session.new", capabilities={})
        self.ask("session.subscribe", events=["log.entryAdded"])
        self._context = self.ask("browsingContext.getTree")["contexts"][0]["context"]

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._connection.recv(timeout=WAIT_S))
            if answer.get("method") == "log.entryAdded" and answer["params"]["level"] in ("error", "warn"):
                self.complaints.append(answer["params"]["text"])
            if answer.get("id") == number:
                assert answer["type"] == "success", answer
                return dict(answer["result"])

    def open(self, address: str) -> None:
        self.ask("browsingContext.setViewport", context=self._context, viewport={"width": 1440, "height": 900})
        self.ask("browsingContext.navigate", context=self._context, url=address, wait="complete")

    def press(self, key: str) -> None:
        strokes = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        hand = {"type": "key", "id": "keyboard", "actions": strokes}
        self.ask("input.performActions", context=self._context, actions=[hand])

    def wait_for(self, **least: Any) -> dict[str, Any]:
        """What the page shows, once each of these numbers is reached, and each of these texts is there."""
        deadline = time.monotonic() + WAIT_S
        while True:
            target = {"context": self._context}
            found = self.ask("script.evaluate", expression=SEEN, target=target, awaitPromise=True)
            shown: dict[str, Any] = json.loads(found["result"]["value"])
            if all(shown[name] == it if isinstance(it, str) else shown[name] >= it for name, it in least.items()):
                return shown
            assert time.monotonic() < deadline, shown


@pytest.fixture
def tab(tmp_path: Path) -> Iterator[Tab]:
    (tmp_path / "user.js").write_text(
        "".join(f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in PREFERENCES.items())
    )
    command = [str(FIREFOX), "--headless", "--no-remote", "--profile", str(tmp_path), "--remote-debugging-port", "0"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as firefox:
        assert firefox.stderr is not None
        try:
            found = next(filter(None, (re.search(rf"{READY}(\S+)", line) for line in firefox.stderr)))
            with connect(f"{found[1]}/session", max_size=None, proxy=None) as connection:
                yield Tab(connection)
        finally:
            firefox.terminate()


@pytest.mark.usefixtures("paused_in_traffic")
def test_it_draws_the_frame_explains_the_lead_and_follows_keys_without_complaint(site: Site, tab: Tab) -> None:
    tab.open(site.address)
    shown = tab.wait_for(frame=START, rows=3, gates=5, camera=1000, plan=10, timeline=4, link="connected")
    assert shown["frame"] == START
    tab.press("\ue014")  # the arrow to the right
    assert tab.wait_for(frame=START + 1)["frame"] == START + 1
    assert tab.complaints == []
