"""A hang is reported on every page that shows the drive."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.common.watchdog import Watchdog
from pipeline.params import Params
from pipeline.recording.segments import Segments
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.browser.conftest import WAIT_MS, Site

WAIT_S = WAIT_MS / 1e3

PAGES = {"/": "#notices", "/drive/": "#notes"}
"""The dashboard, in which labels are edited, and the in-vehicle display, each with the element that shows the
message."""


@pytest.fixture
def on_a_slow_disk(tmp_path: Path) -> Iterator[tuple[Site, Recording]]:
    recording = Recording(count=20_000)  # not read to its end before the disk hangs: what is in memory needs no disk
    watchdog = Watchdog(patience_s=0.2, first_s=2.0)
    engine = Engine(
        opener(recording),
        lambda _: CountingDetector(),
        Params(),
        uri=recording.uri,
        playing=True,
        watchdog=watchdog,
        recorder=SessionRecorder(tmp_path),
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


@pytest.mark.parametrize(
    ("trouble", "said"),
    [
        ("the disk", "The disk does not respond"),
        ("the writer", "The recorder hung for"),
        ("nothing fits", "Recording stopped: No space left on device"),
    ],
)
def test_a_recording_in_trouble_is_said_on_every_page(
    browser: Browser, on_a_slow_disk: tuple[Site, Recording], monkeypatch: pytest.MonkeyPatch, trouble: str, said: str
):
    site, _ = on_a_slow_disk
    gate, write = threading.Event(), Segments.write

    def troubled(self: Segments, *arguments: Any, **named: Any) -> None:
        if trouble == "nothing fits":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if trouble == "the disk":
            with self.disk.waiting():
                assert gate.wait(WAIT_S)
        elif self.frames < 1:
            assert gate.wait(WAIT_S)
        write(self, *arguments, **named)

    monkeypatch.setattr(Segments, "write", troubled)
    pages = {path: browser.new_page() for path in PAGES}
    try:
        for path, page in pages.items():
            page.goto(site.address + path)
        site.engine.recorder.start(site.engine.source)
        for path, page in pages.items():
            expect(page.locator(PAGES[path])).to_contain_text(said, timeout=WAIT_S * 1000)
    finally:
        gate.set()
        for page in pages.values():
            page.context.close()
