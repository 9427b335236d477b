"""Renews ``docs/img/*.jpg`` from the real page on the simulated drive: ``make screenshots``. Needs Chromium."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from app.bench.fleet_sessions import make_sessions
from app.bench.page.devtools import CHROMIUM, FLAGS
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.fleet.batch.work import run_drive
from app.fleet.desk import FleetDesk
from app.fleet.pack import pack
from app.fleet.store import Store
from app.labels.service.desk import LabelDesk
from app.labels.store.database import Database
from pipeline.detection import detector_for, lanes_for
from pipeline.params import Params, with_changes
from pipeline.sources import open_source
from pipeline.vision.far_view import WINDOW_PX
from tests.app.fleet.fleets import begun, plan_of
from tests.app.fleet.s3 import BUCKET, s3_server
from tests.browser.conftest import Site
from tests.browser.labels.hands import begin

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "img"
SOURCE = "sim:straight"
MOMENT = 60
"""A frame with traffic around and a lead."""
QUALITY = 78
"""JPEG quality: a whole page stays below 300 kB with legible text."""
WAIT_MS = 600_000
"""On a busy machine, the whole drive takes minutes, since networks process every image."""
SESSIONS, SECONDS = 40, 5.0
"""Number of sessions of the fleet, and their length."""
DESK, DISPLAY = (1440, 900), (1024, 600)


def main() -> None:
    """Renew all images."""
    expect.set_options(timeout=WAIT_MS)
    with dashboard() as site, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = opened(browser, site)
        save(page, "dashboard")
        page.locator("#objects tbody tr:not(.is-cipv)").first.click()
        expect(page.locator("#why .gate").first).to_be_visible()
        save(page.locator(".why-pane"), "why")
        page.keyboard.press("Escape")
        what_if(page)
        save(page, "whatif")
        page.close()
        site.engine.control.set_params(Params(), "default")

        page = opened(browser, site)
        aligned(page, site)
        save(page, "align")
        page.close()
        site.engine.control.set_params(Params(), "default")

        page = opened(browser, site)
        labeled(page)
        save(page, "label")
        page.close()

        page = browser.new_page(viewport={"width": DISPLAY[0], "height": DISPLAY[1]}, color_scheme="dark")
        site.engine.control.change(playing=True)
        page.goto(f"{site.address}/drive/")
        page.wait_for_function(
            "() => document.body.innerText.includes('m/s') || document.body.innerText.includes('km/h')"
        )
        painted(page)
        save(page, "drive")
        page.close()
        with fleet_of(site) as searched:
            page = opened(browser, searched)
            page.get_by_role("button", name="Fleet", exact=True).click()
            expect(page.locator("#fleet-dialog")).to_have_attribute("aria-busy", "false")
            save(page, "fleet")
        browser.close()


@contextmanager
def fleet_of(site: Site) -> Iterator[Site]:
    """The same dashboard with a fleet of simulated traffic, whose tables are in an S3 on this machine."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch, s3_server(patch, every=0):
        store = Store(f"s3://{BUCKET}/drives")
        make_sessions(Path(folder), SESSIONS, SECONDS)
        work = begun(plan_of(folder), store.address)
        for job in work.jobs:
            run_drive(job)
        pack(store, work.key.name)
        searched = Site(site.engine, 0, fleet=FleetDesk(store.address))
        searched.start()
        try:
            yield searched
        finally:
            searched.stop()


@contextmanager
def dashboard() -> Iterator[Site]:
    """The dashboard on the simulated drive, paused at ``MOMENT``, with sessions and labels of its own."""
    with tempfile.TemporaryDirectory() as folder:
        engine = Engine(
            open_source,
            detector_for,
            Params(),
            uri=SOURCE,
            whole_drives=True,
            open_lanes=lanes_for,
            far_view_px=WINDOW_PX,
            desk=SessionRecorder(Path(folder)),
            labels=LabelDesk(Database.in_file(Path(folder) / "labels.db")),
        )
        engine.start()
        engine.control.change(target=MOMENT)
        engine.wait_for(lambda shown: shown.processed is not None and shown.index == MOMENT, WAIT_MS / 1e3)
        site = Site(engine, 0)
        site.start()
        try:
            yield site
        finally:
            site.stop()
            engine.stop()


def opened(browser: Browser, site: Site) -> Page:
    """The page in the dark theme, with the whole drive computed."""
    page = browser.new_page(viewport={"width": DESK[0], "height": DESK[1]}, color_scheme="dark")
    page.set_default_timeout(WAIT_MS)
    page.goto(site.address)
    page.wait_for_selector("#objects tbody tr", state="attached")
    site.engine.wait_for(lambda shown: shown.drive.total > 0 and shown.drive.done == shown.drive.total, WAIT_MS / 1e3)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")
    painted(page)
    return page


def what_if(page: Page) -> None:
    """Require more sightings by one sensor: two runs on the timeline, with the frames in which they differ."""
    slider = page.locator("[data-param='cipv.confirm_hits'] input[type=range]")
    slider.evaluate("(range) => { range.closest('details').open = true; range.scrollIntoView() }")
    slider.fill("10")
    expect(page.locator("#timeline-facts")).to_contain_text("frames differ")
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")
    page.get_by_role("tab", name="Runs").click()
    expect(page.locator(".metrics tbody tr")).not_to_have_count(0)
    painted(page)


def aligned(page: Page, site: Site) -> None:
    """Alignment mode with two saved alignments; the first is a little off."""
    page.keyboard.press("a")
    versions = page.get_by_role("region", name="Saved alignments")
    page.get_by_role("button", name="Versions").click()
    for count, (yaw_deg, note) in enumerate(((0.5, "after remounting the camera"), (0.0, "as calibrated")), start=1):
        site.engine.control.set_params(with_changes(Params(), {"alignment.yaw_deg": yaw_deg}), "default")
        expect(page.locator("#align-bar .score")).to_have_text(re.compile(r"\d+ %"))
        versions.get_by_role("textbox", name="Note").fill(note)
        versions.get_by_role("button", name="Save").click()
        expect(versions.get_by_role("listitem")).to_have_count(count)
    expect(versions.get_by_role("button", name="Restore alignment 2")).to_be_disabled()
    site.engine.wait_for(lambda shown: shown.drive.total > 0 and shown.drive.done == shown.drive.total, WAIT_MS / 1e3)
    expect(page.locator(".timeline-pane")).to_have_attribute("aria-busy", "false")
    painted(page)


def labeled(page: Page) -> None:
    """Labeling mode with proposals for the whole drive, one track selected and accepted."""
    begin(page)
    page.keyboard.press("p")
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_count(1)
    page.keyboard.press(".")
    expect(page.locator(".track-detail")).to_be_visible()
    page.keyboard.press("a")
    expect(page.locator(".said")).to_contain_text("accepted")
    painted(page)


def painted(page: Page) -> None:
    """Wait until pending drawing is done."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def save(what: Page | Locator, name: str) -> None:
    """Write an image of the page, or of a part of it."""
    path = IMAGES / f"{name}.jpg"
    what.screenshot(path=path, type="jpeg", quality=QUALITY)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
