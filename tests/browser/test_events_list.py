"""What the list of events says while there is none."""

from __future__ import annotations

import numpy as np
from playwright.sync_api import Browser, expect

from app.engine.engine import Engine
from pipeline.params import Params
from pipeline.types import U8, RawBoxes
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.browser.conftest import serving


class Blind(CountingDetector):
    """Detects nothing."""

    def detect(self, bgr: U8) -> RawBoxes:
        return RawBoxes(self.name, np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())


def test_it_says_that_there_is_none_only_once_the_drive_was_searched(browser: Browser) -> None:
    recording = Recording(count=2)  # too few for a lead by the LiDAR alone
    recording.gate.clear()
    engine = Engine(opener(recording), lambda _: Blind(), Params(), uri=recording.uri, whole_drives=True)
    with serving(engine) as site:
        page = browser.new_page()
        try:
            page.goto(site.address)
            said = page.locator("#events-list")
            expect(said).to_have_text("Searching …")
            recording.gate.set()
            expect(said).to_have_text("No events in this recording.")
        finally:
            page.close()
            recording.gate.set()


def test_its_colours_are_those_of_the_theme(browser: Browser) -> None:
    recording = Recording(count=5)
    engine = Engine(opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri, whole_drives=True)
    with serving(engine) as site:
        page = browser.new_page(color_scheme="dark")
        try:
            page.goto(site.address)
            first = page.locator("#events-list .event").first
            dark = first.evaluate("row => row.style.getPropertyValue('--flag')")
            page.click("#theme-button")
            expect(first).not_to_have_css("--flag", dark)
        finally:
            page.close()
