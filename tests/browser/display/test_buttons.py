"""Marking, recording, and what a display is not allowed to do."""

from __future__ import annotations

import re
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.web.guards.tokens import Tokens
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.web.serving import serving
from tests.browser.conftest import START, OpenPage, Site
from tests.browser.display.conftest import WAIT_S, OpenDisplay, is_now, keep

SEEK = """() => fetch("/api/playback", {
  method: "POST", headers: { "content-type": "application/json" }, body: '{"seek": 1}',
}).then((answer) => answer.status)"""


@pytest.mark.usefixtures("paused_in_traffic")
def test_a_marked_moment_lands_on_the_timeline(open_display: OpenDisplay, open_page: OpenPage, site: Site):
    page = open_display(site.address)
    is_now(page, "paused")
    page.locator("#mark").tap()
    expect(page.locator("#answer")).to_have_text(f"✓ Marked, frame {START + 1}")
    keep(page, "drive_marked")
    dashboard = open_page()
    marked = dashboard.locator("#events-list").get_by_text("marked")
    expect(marked).to_have_count(1)
    events = httpx.get(f"{site.address}/api/drive/events", timeout=WAIT_S).json()["events"]
    (mark,) = [event for event in events if event["kind"] == "mark"]
    assert mark["index"] == START
    assert httpx.delete(f"{site.address}/api/marks/{mark['mark']}", timeout=WAIT_S).status_code == 200
    expect(marked).to_have_count(0)


def test_recording_is_begun_and_ended_in_sight(open_display: OpenDisplay, own: tuple[Site, Recording], tmp_path: Path):
    site, _ = own
    page = open_display(site.address)
    record = page.locator("#record")
    is_now(page, "fresh")
    record.tap()
    expect(page.locator("#answer")).to_have_text("✓ Recording")
    expect(record).to_have_attribute("aria-pressed", "true")
    expect(record).to_contain_text(re.compile(r"0:0[1-9]\.\d"))
    record.tap()
    expect(page.locator("#answer")).to_have_text("✓ Recording saved")
    expect(record).to_have_attribute("aria-pressed", "false")
    assert len(list(tmp_path.glob("*.mcap"))) == 1


def test_a_refusal_is_said(open_display: OpenDisplay, tmp_path: Path):
    engine = Engine(opener(), None, Params(), recorder=SessionRecorder(tmp_path))
    engine.start()
    try:
        with serving(create_app(engine)) as address:
            page = open_display(address, quiet=False)
            is_now(page, "waiting")
            page.locator("#record").tap()
            expect(page.locator("#answer")).to_have_text("✕ Recording failed: nothing is open to record")
            page.locator("#mark").tap()
            expect(page.locator("#answer")).to_have_text("✕ Mark failed: no recording is open")
    finally:
        engine.stop()


def test_a_display_comes_by_its_link_and_may_only_what_it_needs(open_display: OpenDisplay, own: tuple[Site, Recording]):
    site, _ = own
    tokens = Tokens("person-0123456789abcdef", "display-0123456789abcde")
    with serving(create_app(site.engine, tokens=tokens)) as address:
        page = open_display(f"{address}/drive/?token={tokens.display}", quiet=False)
        is_now(page, "fresh")
        assert page.url == f"{address}/drive/"
        assert page.evaluate("document.cookie") == ""
        page.locator("#mark").tap()
        expect(page.locator("#answer")).to_contain_text("✓ Marked")
        assert page.evaluate(SEEK) == 403
