"""Renews ``docs/img/*.jpg`` from the real page on the simulated drive: ``make screenshots``. Needs Chromium."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

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
from tests.browser.conftest import Site, serving
from tests.browser.labels.hands import begin

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "img"
SOURCE = "sim:straight"
MOMENT = 60
"""A frame with traffic around and a lead."""
FAR_SOURCE, FAR_OFF, RANGED = "sim:ccrs_100", 24, 40
"""A car that stands on the road; the frames in which it is 95 m ahead, and in which one LiDAR return ranges it."""
QUALITY = 78
"""JPEG quality: a whole page stays below 300 kB with legible text."""
WAIT_MS = 600_000
"""On a busy machine, the whole drive takes minutes, since networks process every image."""
SESSIONS, SECONDS = 40, 5.0
"""Number of sessions of the fleet, and their length."""
DESK, DISPLAY = (1440, 900), (1024, 600)


class Part(NamedTuple):
    """Neighbouring panes of a page."""

    page: Page
    """The page."""
    panes: tuple[str, ...]
    """Their selectors."""

    def screenshot(self, **how: Any) -> bytes:
        """Take a picture of the rectangle around them."""
        boxes = [box for pane in self.panes if (box := self.page.locator(pane).bounding_box()) is not None]
        x, y = min(box["x"] for box in boxes), min(box["y"] for box in boxes)
        right, below = max(box["x"] + box["width"] for box in boxes), max(box["y"] + box["height"] for box in boxes)
        return self.page.screenshot(clip={"x": x, "y": y, "width": right - x, "height": below - y}, **how)


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
            page.close()
        with dashboard(FAR_SOURCE, FAR_OFF) as distant:
            far_away(browser, distant)
        browser.close()


def far_away(browser: Browser, site: Site) -> None:
    """A car far ahead without and with the far view, and nearer, with a single LiDAR return that ranges it."""
    with looking_ahead(browser, site, far_view=False, moment=FAR_OFF) as view:
        save(view, "far-without")
    with looking_ahead(browser, site, far_view=True, moment=FAR_OFF) as view:
        save(view, "far-with")
    with looking_ahead(browser, site, far_view=True, moment=RANGED) as view:
        save(view, "far-returns")


@contextmanager
def looking_ahead(browser: Browser, site: Site, far_view: bool, moment: int) -> Iterator[Part]:
    """Camera and plan of a moment, with the image zoomed to the end of the road and the CIPV selected."""
    site.engine.control.set_params(with_changes(Params(), {"detection.far_view": far_view}), "default")
    site.engine.control.change(target=moment)
    page = opened(browser, site)
    expect(page.locator("#transport")).to_contain_text(f"{moment:06d}")
    if far_view:
        page.locator("#objects tbody tr.is-cipv").click()
    image = page.locator(".camera-pane canvas").first.bounding_box()
    assert image is not None
    page.mouse.move(image["x"] + image["width"] / 2, image["y"] + image["height"] * 0.45)
    page.mouse.wheel(0, -700)
    painted(page)
    yield Part(page, (".camera-pane", ".bev-pane"))
    page.close()


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
def dashboard(uri: str = SOURCE, moment: int = MOMENT) -> Iterator[Site]:
    """The dashboard on a simulated drive, paused at a moment, with sessions and labels of its own."""
    with tempfile.TemporaryDirectory() as folder:
        engine = Engine(
            open_source,
            detector_for,
            Params(),
            uri=uri,
            whole_drives=True,
            open_lanes=lanes_for,
            far_view_px=WINDOW_PX,
            recorder=SessionRecorder(Path(folder)),
            labels=LabelDesk(Database.in_file(Path(folder) / "labels.db")),
        )
        with serving(engine) as site:
            engine.control.change(target=moment)
            engine.wait_for(lambda shown: shown.processed is not None and shown.index == moment, WAIT_MS / 1e3)
            yield site


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
    expect(page.locator("#align-bar .score")).not_to_contain_text("better")  # the score of the second
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


def save(what: Page | Locator | Part, name: str) -> None:
    """Write an image of the page, or of a part of it."""
    path = IMAGES / f"{name}.jpg"
    what.screenshot(path=path, type="jpeg", quality=QUALITY)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
