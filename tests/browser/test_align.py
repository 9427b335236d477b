"""Fit as a person uses it: pressed, watched, cancelled, applied, undone, kept and restored; and the sliders alone."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from app.engine.engine import Engine
from pipeline.alignment.projection import corrected
from pipeline.common.geometry import inverse
from pipeline.formats.calibration_files import opencv
from pipeline.formats.calibration_files.contents import GivenFile
from pipeline.params import AlignmentParams, Params, with_changes
from pipeline.sources import open_source
from pipeline.types import Frame
from tests.browser.conftest import WAIT_MS, CountedDetector, OpenPage, Pages, Site, opening
from tests.browser.looks import pixels, repainted
from tests.looking import ReadsOnce

WAIT_S = WAIT_MS / 1e3
SCENE = """
title: a knocked camera
seed: 4
duration_s: 5
rate_hz: 10
road: {segments: [{length_m: 1000}], lanes_forward: 3}
ego: {lane: -2, speed_mps: {0: 12}}
detections: {boxes: {}}
faults: {camera_yaw_deg: 2.0, camera_pitch_deg: -1.5}
actors:
  - {id: 1, kind: car, lane: -2, ahead_m: 18, speed_mps: {0: 10}}
  - {id: 2, kind: car, lane: -1, ahead_m: 12, speed_mps: {0: 14}}
  - {id: 3, kind: car, lane: -3, ahead_m: 14, speed_mps: {0: 13}}
  - {id: 4, kind: car, lane: -1, ahead_m: 30, speed_mps: {0: 11}}
  - {id: 5, kind: van, lane: -3, ahead_m: 28, speed_mps: {0: 12}}
"""


@pytest.fixture(scope="module")
def knocked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A dashboard on a drive whose camera is rotated relative to its calibration."""
    scene = tmp_path_factory.mktemp("scene") / "knocked.yaml"
    scene.write_text(SCENE)
    drawn = ReadsOnce(open_source(f"sim:{scene}"))
    engine = Engine(lambda uri, progress: drawn, CountedDetector, Params(), uri=drawn.uri, whole_drives=True)
    engine.start()
    engine.wait_for(lambda s: s.processed is not None, WAIT_S)
    site = Site(engine, 0)
    site.start()
    yield site
    site.stop()
    engine.stop()


@pytest.fixture
def page(pages, knocked: Site) -> Iterator[Page]:
    knocked.engine.control.set_params(Params(), "default")
    knocked.engine.wait_for(  # until the run of what the test before left is gone
        lambda s: s.params == Params() and s.drive.done == s.drive.total > 0, WAIT_S
    )
    with opening(pages, knocked) as begin:
        page = begin(expects=("status of 409",))  # of a file that is refused
        page.keyboard.press("a")
        yield page


def alignment(site: Site) -> Params:
    return site.engine.control.peek().params


def test_a_fit_is_watched_applied_kept_and_undone(page: Page, knocked: Site):
    page.get_by_role("button", name="Fit", exact=True).click()
    expect(page.get_by_label("Fitting the alignment")).to_be_visible()
    result = page.get_by_label("Fitted alignment")
    expect(result).to_contain_text(re.compile(r"Fitted to \d+ vehicles in \d+ frames"))
    expect(result).to_contain_text("±")
    assert alignment(knocked) == Params(), "nothing changes before Apply"
    result.get_by_role("button", name="Apply").click()
    fitted = knocked.engine.wait_for(lambda s: s.params != Params(), WAIT_S).params
    assert fitted.alignment.yaw_deg == pytest.approx(2.0, abs=0.3)
    assert fitted.alignment.pitch_deg == pytest.approx(-1.5, abs=0.3)
    expect(result).to_be_hidden()

    page.get_by_role("button", name="Versions").click()
    versions = page.get_by_label("Saved alignments")
    expect(versions).to_contain_text(re.compile(r"IoU \d+ %.*Fit"))
    expect(versions.get_by_role("button", name="Restore alignment 1")).to_be_disabled()
    page.locator("#camera").click(position={"x": 5, "y": 5})
    page.keyboard.press("Control+z")
    knocked.engine.wait_for(lambda s: s.params == Params(), WAIT_S)
    versions.get_by_role("button", name="Restore alignment 1").click()
    knocked.engine.wait_for(lambda s: s.params == fitted, WAIT_S)
    page.locator("#camera").click(position={"x": 5, "y": 5})
    page.keyboard.press("Control+z")
    knocked.engine.wait_for(lambda s: s.params == Params(), WAIT_S)

    versions.get_by_label("Note").fill("as delivered")
    versions.get_by_role("button", name="Save").click()
    expect(versions.locator("li")).to_have_count(2)
    expect(versions.locator("li").first).to_contain_text("as delivered")
    for number in (1, 2):
        versions.get_by_role("button", name=f"Delete alignment {number}").click()
        expect(versions.locator("li")).to_have_count(2 - number)


def test_a_fit_is_cancelled_and_changes_nothing(page: Page, knocked: Site):
    page.get_by_role("button", name="Fit", exact=True).click()
    page.get_by_role("button", name="Cancel", exact=True).click()
    expect(page.get_by_role("button", name="Fit", exact=True)).to_be_visible()
    expect(page.get_by_label("Fitted alignment")).to_be_hidden()
    assert page.request.get(f"{knocked.address}/api/alignment/fit").json()["state"] == "none"
    assert alignment(knocked) == Params()


def exported(page: Page, panel: Locator) -> Path:
    """The calibration with the current alignment."""
    with page.expect_download() as download:
        panel.get_by_role("link", name="OpenCV").click()
    return download.value.path()


def test_a_calibration_goes_out_and_comes_back_as_one_step(page: Page, knocked: Site, tmp_path: Path):
    page.get_by_role("button", name="Files", exact=True).click()
    panel = page.get_by_label("Calibration files")
    camera = opencv.parse({"": GivenFile("out.yaml", exported(page, panel).read_bytes())}, None)
    moved = AlignmentParams(yaw_deg=2.0, pitch_deg=-1.5, forward_m=0.1)
    opencv.write(tmp_path / "in.yaml", corrected(moved, camera))
    opencv.write(tmp_path / "wrong.yaml", replace(camera, T_camera_ego=inverse(camera.T_camera_ego)))

    page.get_by_label("Files to import").set_input_files(tmp_path / "wrong.yaml")
    result = page.get_by_label("Imported calibration")
    expect(result).to_contain_text("is its extrinsic inverted?")
    expect(result.get_by_role("button", name="Apply")).to_be_hidden()
    result.get_by_role("button", name="Dismiss").click()

    page.set_viewport_size({"width": 800, "height": 480})
    page.get_by_label("Files to import").set_input_files(tmp_path / "in.yaml")
    expect(result).to_contain_text(re.compile(r"OpenCV: in\.yaml.*yaw2\.00°.*pitch−1\.50°.*forward0\.10 m"))
    assert alignment(knocked) == Params(), "nothing changes before Apply"
    apply = result.get_by_role("button", name="Apply")
    expect(result).to_be_visible()
    result.locator(".warnings").evaluate("(list) => list.append(...Array(9).fill('many warnings, ' + 'x '.repeat(50)))")
    expect(apply).to_be_in_viewport(ratio=1.0)
    apply.click()
    found = knocked.engine.wait_for(lambda s: s.params != Params(), WAIT_S).params
    assert found.alignment.forward_m == pytest.approx(0.1, abs=1e-3)
    expect(result).to_be_hidden()
    page.set_viewport_size({"width": 1440, "height": 900})
    page.get_by_role("button", name="Versions").click()
    versions = page.get_by_label("Saved alignments")
    expect(versions).to_contain_text("Imported from in.yaml")
    page.locator("#camera").click(position={"x": 5, "y": 5})
    page.keyboard.press("Control+z")
    knocked.engine.wait_for(lambda s: s.params == Params(), WAIT_S)
    versions.get_by_role("button", name=re.compile("Delete alignment")).click()
    expect(versions.locator("li")).to_have_count(0)


def test_the_position_is_fitted_where_the_switch_says_so(page: Page):
    position, bar = page.get_by_label("Position", exact=True), page.locator("#align-bar")
    bar.get_by_role("button", name="angular", exact=True).click()
    expect(position).to_be_disabled()
    bar.get_by_role("button", name="pinhole", exact=True).click()
    position.check()
    page.get_by_role("button", name="Fit", exact=True).click()
    result = page.get_by_label("Fitted alignment")
    expect(result).to_contain_text(re.compile(r"left−?\d\.\d\d m ± .*up−?\d\.\d\d m ±"))
    result.get_by_role("button", name="Dismiss").click()
    expect(result).to_be_hidden()


def test_the_bar_is_one_row_while_fitting_and_the_first_slider_is_in_sight(page: Page):
    """A second row would move the image under the hand as soon as a fit begins."""
    bar = page.locator("#align-bar")
    expect(bar.locator(".score")).to_contain_text("better")
    rows = """bar => new Set([...bar.children].filter((child) => child.offsetHeight).map(
        (child) => Math.round((child.offsetTop + child.offsetHeight / 2) / 16))).size"""
    bar.get_by_role("button", name="Fit", exact=True).click()
    expect(page.get_by_label("Fitting the alignment")).to_be_visible()
    assert bar.evaluate(rows) == 1
    bar.get_by_role("button", name="Cancel", exact=True).click()
    page.set_viewport_size({"width": 1280, "height": 720})
    for name, first in (("angular", "h_res_deg"), ("pinhole", "yaw_deg")):
        bar.get_by_role("button", name=name, exact=True).click()
        expect(page.locator(f"[data-param='alignment.{first}'] input[type=range]")).to_be_in_viewport(ratio=1.0)


def test_in_a_small_window_nothing_covers_the_image_and_every_button_is_in_sight(page: Page):
    page.keyboard.press("a")
    page.set_viewport_size({"width": 720, "height": 450})
    page.keyboard.press("a")
    expect(page.locator("html")).to_have_attribute("data-inspect", "closed")
    bar = page.locator("#align-bar")
    for name in ("pinhole", "Fit", "Time", "Pairs", "Versions", "Files", "Edges", "Regions"):
        button = bar.get_by_role("button", name=name, exact=True)
        expect(button).to_be_in_viewport(ratio=1.0)
        button.click(trial=True)
    bar.get_by_role("button", name="Fit", exact=True).click()
    result = page.get_by_label("Fitted alignment")
    apply = result.get_by_role("button", name="Apply")
    expect(apply).to_be_in_viewport(ratio=1.0)
    apply.click(trial=True)
    result.get_by_role("button", name="Dismiss").click()
    bar.get_by_role("button", name="Versions").click()
    save = page.get_by_label("Saved alignments").get_by_role("button", name="Save")
    expect(save).to_be_in_viewport(ratio=1.0)
    save.click(trial=True)


LATE_MS = 100.0


class LateCamera:
    """Six seconds of a bend whose images are those of the next frame."""

    def __init__(self) -> None:
        self._bend = ReadsOnce(open_source("sim:curve_125"))
        self.uri, self.title, self.rate_hz = "sim:late", "a late camera", self._bend.rate_hz
        self.calibrated_focal_px, self.notes, self.images_given = None, (), True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bend, name)

    def __len__(self) -> int:
        return 60

    def frame(self, index: int) -> Frame:
        own, image = self._bend.frame(index), self._bend.frame(index + 1).image
        assert own.image is not None
        assert image is not None
        return replace(own, image=replace(image, t_ns=own.image.t_ns))


def test_the_time_offset_is_shown_applied_on_consent_and_undone(pages: Pages):
    engine = Engine(lambda uri, progress: LateCamera(), CountedDetector, Params(), uri="sim:late", whole_drives=True)
    engine.start()
    engine.wait_for(lambda s: s.processed is not None, WAIT_S)
    site = Site(engine, 0)
    site.start()
    try:
        with opening(pages, site) as begin:
            page = begin()
            page.keyboard.press("a")
            page.get_by_role("button", name="Time", exact=True).click()
            result = page.get_by_label("Time offsets", exact=True)
            expect(result).to_contain_text(re.compile(r"Camera\d+\.\d ms ± \d"))
            expect(result).to_contain_text("ego speed changes too little")
            assert alignment(site) == Params(), "nothing changes before Apply"
            result.get_by_role("button", name="Apply").click()
            found = engine.wait_for(lambda s: s.params != Params(), WAIT_S).params
            assert found.sync.camera_offset_ms == pytest.approx(LATE_MS, abs=5.0)
            expect(result).to_be_hidden()
            page.locator("#camera").click(position={"x": 5, "y": 5})
            page.keyboard.press("Control+z")
            engine.wait_for(lambda s: s.params == Params(), WAIT_S)
    finally:
        site.stop()
        engine.stop()


MOST_MOVES, MOST_S = 8, 120.0


def test_the_sliders_alone_align_a_turned_rig(open_page: OpenPage, site: Site, paused_in_traffic: None):
    turned = with_changes(Params(), {"alignment.yaw_deg": -2.0, "alignment.pitch_deg": 1.5})
    site.engine.control.set_params(turned, "default")
    site.engine.wait_for(  # until detectors have looked at all frames
        lambda s: s.params == turned and s.drive.done == s.drive.total > 0, WAIT_S
    )
    page = open_page()
    page.keyboard.press("a")
    expect(page.locator("#align-bar .score")).to_have_text(re.compile(r"\d+ %"))
    begun, moves = time.monotonic(), 0
    while suggested := re.findall(r"(yaw|pitch) ([+-][\d.]+)°", page.locator("#align-bar .score").inner_text()):
        for name, by in suggested:
            slider = page.locator(f"[data-param='alignment.{name}_deg'] input[type=range]")
            slider.fill(f"{float(slider.input_value()) + float(by):.2f}")
            moves += 1
        wanted = {name: float(page.locator(f"[data-param='alignment.{name}_deg'] input[type=range]").input_value())
                  for name, _ in suggested}  # fmt: skip
        site.engine.wait_for(
            lambda s, wanted=wanted: all(getattr(s.params.alignment, f"{k}_deg") == v for k, v in wanted.items()),
            WAIT_S,
        )
        score = page.request.get(f"{site.address}/api/alignment/score").json()
        expect(page.locator("#align-bar .score")).to_have_text(score["brief"])
        assert moves <= MOST_MOVES
    took_s = time.monotonic() - begun
    found = site.engine.control.peek().params.alignment
    print(f"aligned by {moves} moves in {took_s:.1f} s: yaw {found.yaw_deg:.2f}°, pitch {found.pitch_deg:.2f}°")
    assert moves > 0
    assert abs(found.yaw_deg) <= 0.5
    assert abs(found.pitch_deg) <= 0.5, "which vehicles show; drawn images have few edges that end above or below"
    assert took_s < MOST_S
    assert "%" in page.locator(".ranges").inner_text()
    regions = page.get_by_role("button", name="Regions")
    shown = pixels(page, "#camera")
    regions.click()
    assert repainted(page, "#camera", shown), "the heat map goes"
