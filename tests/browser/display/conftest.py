"""The in-vehicle display on a touch screen, and a dashboard for one test alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.browser.conftest import WAIT_MS, Site

WAIT_S = WAIT_MS / 1e3
SCREENS = Path(__file__).resolve().parents[3] / "build" / "screens"

OpenDisplay = Callable[..., Page]


@pytest.fixture
def open_display(browser: Browser, request: pytest.FixtureRequest) -> Iterator[OpenDisplay]:
    """Opens the display in an empty profile with touch. At the end, no page may have logged an error or sent a request
    elsewhere."""
    if "own" in request.fixturenames:
        request.getfixturevalue("own")  # requested first, so that the server outlives its pages
    complaints: list[str] = []
    pages: list[Page] = []

    def begin(address: str, width: int = 1024, height: int = 600, *, quiet: bool = True, **context: Any) -> Page:
        page = browser.new_page(viewport={"width": width, "height": height}, has_touch=True, **context)
        pages.append(page)
        page.context.set_default_timeout(WAIT_MS)
        if quiet:
            page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
            page.on("pageerror", lambda error: complaints.append(str(error)))
        host = address.partition("//")[2].partition("/")[0]
        page.on("request", lambda r: complaints.append(r.url) if "://" in r.url and host not in r.url else None)
        page.goto(address if "/drive" in address else f"{address}/drive/")
        return page

    yield begin
    for page in pages:
        page.context.close()
    assert [text for text in complaints if not text.startswith(("blob:", "data:"))] == []


@pytest.fixture
def detector() -> CountingDetector:
    """The network of ``own``."""
    return CountingDetector()


@pytest.fixture
def own(tmp_path: Path, detector: CountingDetector) -> Iterator[tuple[Site, Recording]]:
    """A playing dashboard for this test alone."""
    recording = Recording()
    engine = Engine(
        opener(recording),
        lambda _: detector,
        Params(),
        uri=recording.uri,
        playing=True,
        recorder=SessionRecorder(tmp_path),
    )
    engine.start()
    site = Site(engine, 0)
    site.start()
    yield site, recording
    recording.gate.set()
    site.stop()
    engine.stop()


def keep(page: Page, name: str) -> None:
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.screenshot(path=SCREENS / f"{name}.png")


def is_now(page: Page, kind: str) -> None:
    expect(page.locator("html")).to_have_attribute("data-freshness", kind)
