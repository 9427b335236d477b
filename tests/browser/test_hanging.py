"""A hang is reported on every page that shows the drive."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from app.core.watchdog import Watchdog
from app.engine.engine import Engine
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.browser.conftest import WAIT_MS, Site

WAIT_S = WAIT_MS / 1e3

PAGES = {"/": "#notices", "/drive/": "#notes"}
"""The dashboard, in which labels are edited, and the in-vehicle display, each with the element that shows the
message."""


@pytest.fixture
def on_a_slow_disk() -> Iterator[tuple[Site, Recording]]:
    recording = Recording(count=20_000)  # not read to its end before the disk hangs: what is in memory needs no disk
    watchdog = Watchdog(patience_s=0.2, first_s=2.0)
    engine = Engine(
        opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri, playing=True, watchdog=watchdog
    )
    engine.start()
    site = Site(engine, 0)
    site.start()
    yield site, recording
    recording.gate.set()
    site.stop()
    engine.stop()


def test_a_disk_that_hangs_is_said_on_every_page(browser: Browser, on_a_slow_disk: tuple[Site, Recording]):
    site, recording = on_a_slow_disk
    pages = {path: browser.new_page() for path in PAGES}
    try:
        for path, page in pages.items():
            page.goto(site.address + path)
        site.engine.wait_for(lambda shown: shown.index > 1, WAIT_S)
        recording.gate.clear()
        for path, page in pages.items():
            expect(page.locator(PAGES[path])).to_contain_text("reading a frame", timeout=WAIT_S * 1000)
    finally:
        for page in pages.values():
            page.context.close()
