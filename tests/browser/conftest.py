"""A real server on the simulator, and a real browser without console errors or requests to other machines."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, ViewportSize, expect, sync_playwright

from app.bench.page.devtools import CHROMIUM, FLAGS
from app.core.server_address import listen_socket
from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.fleet.desk import FleetDesk
from app.views.lazy_scene import LateScene
from app.web.server import Server, create_app
from pipeline.detection import detector_for
from pipeline.inference.runtime import DetectorMissing
from pipeline.params import Params
from pipeline.sources import Source, open_source
from pipeline.types import U8, RawBoxes
from pipeline.vision.detector import Detector

_SHELL = Path("/usr/bin/chromium-headless-shell")
_BROWSER = _SHELL if _SHELL.exists() else CHROMIUM
"""The same engine without windows of its own takes a fifth less processor time."""
WAIT_MS = 180_000
_SERVERS = 2
"""That of all files, and that of the file that is run."""
ColorScheme = Literal["dark", "light"]
START = 60
"""A frame of the scenario with traffic around."""
expect.set_options(timeout=WAIT_MS)


class CountedDetector:
    """The installed network with a count of its calls; without a network, it returns no boxes."""

    notes: tuple[str, ...] = ()

    def __init__(self, source: Source) -> None:
        self.calls = 0
        self._network: Detector | None
        try:
            self._network = detector_for(source)
        except DetectorMissing:
            self._network = None

    @property
    def name(self) -> str:
        return self._network.name if self._network else "none"

    def detect(self, bgr: U8) -> RawBoxes:
        self.calls += 1
        if self._network is not None:
            return self._network.detect(bgr)
        return RawBoxes(self.name, np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())


@dataclass
class Site:
    """A running dashboard. ``stop`` ends its server; for the pages, that looks like a crash."""

    engine: Engine
    port: int
    detectors: list[CountedDetector] = field(default_factory=list)
    fleet: FleetDesk | None = None
    looks: SharedViewState | None = None
    scene: LateScene | None = None
    """The 3D view, for tests that look at it; it needs ``looks``."""
    _server: Server | None = None
    _thread: threading.Thread | None = None

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def network_runs(self) -> int:
        return sum(detector.calls for detector in self.detectors)

    def start(self) -> None:
        bound, is_ready = listen_socket("127.0.0.1", self.port, strict=True), threading.Event()
        self.port = bound.getsockname()[1]
        viser_port = self.scene.port if self.scene is not None else lambda: None
        app = create_app(self.engine, viser_port, looks=self.looks, fleet=self.fleet)
        server = Server(app, self.address, lambda _: is_ready.set())
        self._server, self._thread = server, threading.Thread(target=lambda: server.run(sockets=[bound]))
        self._thread.start()
        assert is_ready.wait(60)

    def stop(self) -> None:
        assert self._server is not None
        assert self._thread is not None
        self._server.should_exit = True
        self._thread.join()


@contextmanager
def serving(engine: Engine) -> Iterator[Site]:
    """The dashboard of an engine of its own, which both end with the block."""
    engine.start()
    site = Site(engine, 0)
    site.start()
    try:
        yield site
    finally:
        site.stop()
        engine.stop()


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The dashboard on ``sim:straight``, paused on its first frame."""
    detectors: list[CountedDetector] = []

    def open_counted(source: Source) -> CountedDetector:
        detectors.append(CountedDetector(source))
        return detectors[-1]

    desk = SessionRecorder(tmp_path_factory.mktemp("sessions"))
    engine = Engine(open_source, open_counted, Params(), uri="sim:straight", whole_drives=True, recorder=desk)
    engine.start()
    engine.wait_for(lambda s: s.processed is not None, 120)
    running = Site(engine, 0, detectors)
    running.start()
    yield running
    running.stop()
    engine.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    if not _BROWSER.exists():
        if os.environ.get("CIPV_BROWSER_TESTS") == "1":
            pytest.fail(f"CIPV_BROWSER_TESTS=1, but there is no {CHROMIUM}")
        pytest.skip(f"no {CHROMIUM}: the page is not looked at")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(_BROWSER), args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def paused_in_traffic(site: Site) -> None:
    """Pause at frame ``START`` with default parameters."""
    control, before = site.engine.control, site.engine.snapshot.sequence
    control.set_params(Params(), "default")
    control.change(playing=False, speed=1.0, loop=True, target=START, steps=0)
    site.engine.wait_for(
        lambda s: s.sequence > before and s.params == Params() and s.index == START and not s.playing, WAIT_MS / 1e3
    )


class Pages:
    """Pages that are reset and reused, which takes half the time of a new one."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._spare: dict[str, list[Page]] = {}
        """By origin: for another server, a page would take a new process. Those of the last ``_SERVERS`` are kept."""

    def take(self, origin: str, width: int, height: int, color_scheme: ColorScheme, **context: Any) -> Page:
        """A page without stored data for this origin; a new one if it needs its own context."""
        size = ViewportSize(width=width, height=height)
        spare = self._spare.get(origin)
        if context or not spare:
            return self._browser.new_page(viewport=size, color_scheme=color_scheme, **context)
        page = spare.pop()
        page.set_viewport_size(size)
        page.emulate_media(color_scheme=color_scheme)
        return page

    def put_back(self, page: Page, origin: str) -> None:
        """Return a page, after removing everything that it or its test stored. origin: the origin whose data is
        cleared."""
        if page.is_closed():
            return
        # first: a page may store something as it is left
        page.goto(f"{origin}/icon.svg")
        devtools = page.context.new_cdp_session(page)
        devtools.send("Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "all"})
        devtools.detach()
        page.evaluate("sessionStorage.clear()")  # the tab's own, which is no origin's data to DevTools
        page.context.clear_permissions()
        page.unroute_all()
        page.mouse.move(0, 0)
        self._spare[origin] = [*self._spare.pop(origin, []), page]
        while len(self._spare) > _SERVERS:
            for old in self._spare.pop(next(iter(self._spare))):
                old.context.close()


@pytest.fixture(scope="session")
def pages(browser: Browser) -> Pages:
    return Pages(browser)


OpenPage = Callable[..., Page]


@pytest.fixture
def open_page(pages: Pages, site: Site) -> Iterator[OpenPage]:
    with opening(pages, site) as begin:
        yield begin


@contextmanager
def opening(pages: Pages, site: Site) -> Iterator[OpenPage]:
    """Opens the dashboard in an empty profile. At the end, no page may have logged an error or sent a request
    elsewhere. ``expects``: parts of the messages that the test provokes, since browsers log every refused request."""
    complaints: list[str] = []
    opened: list[tuple[Page, dict[str, Callable[[Any], None]], bool]] = []

    def begin(
        width: int = 1440,
        height: int = 900,
        address: str | None = None,
        expects: tuple[str, ...] = (),
        color_scheme: ColorScheme = "dark",
        **context: Any,
    ) -> Page:
        own = (address or site.address).partition("/#")[0]

        def complain(text: str) -> None:
            if not any(words in text for words in expects):
                complaints.append(text)

        def said(message: ConsoleMessage) -> None:
            if message.type in ("error", "warning"):
                complain(f"{message.text} ({message.location.get('url', '')})")

        def asked(request: Request) -> None:
            if _leaves(request.url, own):
                complaints.append(request.url)

        page = pages.take(own, width, height, color_scheme, **context)
        listeners = {"console": said, "request": asked, "pageerror": lambda error: complain(str(error))}
        opened.append((page, listeners, own == site.address and not context))
        page.context.set_default_timeout(WAIT_MS)  # of the requests, too, that the test sends itself
        for event, listener in listeners.items():
            page.on(event, listener)
        page.goto(address or site.address)
        expect(page.locator("#transport .name")).not_to_be_empty()
        page.wait_for_selector("#objects tbody tr", state="attached")
        return page

    yield begin
    for page, listeners, is_plain in opened:
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
        if is_plain and not complaints:
            pages.put_back(page, site.address)
        else:
            page.context.close()
    assert complaints == []


def _leaves(url: str, address: str) -> bool:
    return not url.startswith((address, address.replace("http", "ws"), "data:", "blob:"))
