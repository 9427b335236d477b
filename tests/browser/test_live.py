"""Live sensors on the pages: a real source on loopback that a simulated car sends to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.engine.engine import Engine
from pipeline.params import Params
from pipeline.sources import open_any
from pipeline.sources.live.config import load
from pipeline.types.source import is_live_source
from tests.app.engine.recording_helpers import CountingDetector
from tests.browser.conftest import WAIT_MS, OpenPage, Site
from tests.browser.display.conftest import keep
from tests.pipeline.sources.live.rig import Replaying
from tests.soak.live import car as live_car
from tests.soak.live.run import config_file

SENDS_S, CLIP = 240.0, 6
"""Longer than any wait of the test; the frames of the clip, played back and forth."""


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Site, Replaying]]:
    """A dashboard on live sensors, and the sending car."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live_car, "SPAN", CLIP)
        clip = live_car.clip()
    config = config_file(tmp_path_factory.mktemp("car"))
    engine = Engine(open_any, lambda _: CountingDetector(), Params(), uri=f"live:{config}", playing=True)
    engine.start()
    engine.wait_for(lambda s: s.live, WAIT_MS / 1e3)
    with Replaying(load(config), live_car.messages(*clip, SENDS_S)) as sending:
        engine.wait_for(lambda s: s.processed is not None, WAIT_MS / 1e3)
        site = Site(engine, 0)
        site.start()
        yield site, sending
        site.stop()
    engine.stop()


def until(page: Page, holds: str, gives: str = "get('frame').state.sequence") -> Any:
    """Wait until a condition on the store holds, and return a value from it; both are expressions of ``get``."""
    return page.evaluate(
        f"""async () => {{
          const {{ get, on }} = await import('/js/core/store.js');
          const holds = () => {holds};
          if (!holds()) await new Promise((done) => on(['frame', 'drive', 'state'], () => holds() && done()));
          return {gives};
        }}"""
    )


def test_live_sensors_are_watched_held_and_let_go_on(open_page: OpenPage, car: tuple[Site, Replaying]):
    site, _ = car
    page = open_page(address=site.address)
    expect(page.locator("#transport .live")).to_be_visible()
    for name in ("Step back", "Step forward"):
        expect(page.get_by_role("button", name=name)).to_be_disabled()
    seen = until(page, "get('frame').bitmap && get('frame').count > 1000 && get('drive')?.count > 5")
    assert until(page, f"get('frame').state.sequence > {seen} + 3") > seen + 3, "it goes on by itself"
    source = site.engine.source
    assert source is not None
    assert is_live_source(source)
    source.dropped += 1000
    expect(page.locator("#vitals div", has_text="skipped")).to_contain_text(re.compile(r"skipped1\d{3}$"))
    page.keyboard.press("Space")
    site.engine.wait_for(lambda s: not s.playing, WAIT_MS / 1e3)
    until(page, "!get('state').playing")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    held = site.engine.snapshot.sequence
    page.keyboard.press("Space")
    until(page, f"get('state').playing && get('frame').state.sequence > {held}")


def test_a_moment_marked_in_the_car_is_on_the_dashboards_timeline(open_page: OpenPage, car: tuple[Site, Replaying]):
    site, _ = car
    page = open_page(address=site.address)
    until(page, "get('drive')?.count > 3")
    expect(page.locator("#events-list")).to_have_text("Marks appear here. Events are detected in recordings only.")
    assert page.context.browser is not None
    display = page.context.browser.new_page()
    display.goto(f"{site.address}/drive/")
    expect(display.locator("html")).to_have_attribute("data-freshness", "fresh")
    display.locator("#mark").click()
    expect(display.locator("#answer")).to_have_text(re.compile(r"✓ Marked at \d+:\d\d\.\d, not recorded"))
    display.close()
    row = page.locator("#events-list .event-row")
    expect(row).to_contain_text("Mark")
    keep(page, "live_mark")
    t_s, shown_s, next_s = until(
        page,
        "get('drive').events.length === 1 && get('drive').events[0].index < get('drive').count - 1",
        "(({ events: [{ t_s, index }], t_s: times }) => [t_s, times[index], times[index + 1]])(get('drive'))",
    )
    assert shown_s <= t_s + 0.001 < next_s, "its flag is at the frame that was shown, though a busy page skips some"
    expect(row.locator(".event")).to_be_disabled()
    row.get_by_role("button", name="Remove mark").click()
    expect(row).to_have_count(0)


def test_what_live_sensors_cannot_do_is_off_and_says_why(open_page: OpenPage, car: tuple[Site, Replaying]):
    site, _ = car
    page = open_page(address=site.address)
    until(page, "get('drive')?.count > 3")
    for part in ("#export-button", "#clip-in", "#clip-out", "#event-back", "#event-next"):
        expect(page.locator(part)).to_be_disabled()
        expect(page.locator(part)).to_have_attribute("title", re.compile("Record a session, then open it"))
    page.keyboard.press("i")
    assert until(page, "true", "get('clip')") is None
    page.get_by_role("tab", name="Runs").click()
    page.get_by_role("tab", name="rerun").click()
    for place in (page.locator("#runs"), page.locator("#rerun-body")):
        expect(place.get_by_text("Not available with live sensors")).to_be_visible()
    page.keyboard.press("a")
    expect(page.locator("#align-bar .score")).to_have_text(re.compile(r"\d+ %|no clear best|too few edges"))


def test_a_lidar_that_falls_silent_is_said_at_the_display_and_covered(open_page: OpenPage, car: tuple[Site, Replaying]):
    site, sending = car
    page = open_page(address=site.address)
    page.goto(f"{site.address}/drive/")
    lidar = page.locator("#sensors li", has_text="LiDAR")
    expect(lidar).to_contain_text("Hz")
    sending.stop()
    expect(lidar).not_to_contain_text("Hz")
    expect(page.locator("html")).not_to_have_attribute("data-freshness", "fresh")
