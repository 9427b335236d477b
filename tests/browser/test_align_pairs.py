"""Pairs as a person picks them: points and pixels pressed, a wrong one found, undone, removed, the fit applied; with a
finger, too."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.engine.engine import Engine
from pipeline.alignment.projection import resolve
from pipeline.params import Params, with_changes
from pipeline.sources import open_source
from pipeline.types import F64
from tests.browser.conftest import WAIT_MS, CountedDetector, Pages, Site, opening, serving
from tests.browser.test_align import SCENE

WAIT_S = WAIT_MS / 1e3
TURNED = {"alignment.yaw_deg": 2.0, "alignment.pitch_deg": -1.5}
"""How the camera of the scene is turned."""
FRAME = 10
Press = Callable[[Locator, float, float], None]


@pytest.fixture(scope="module")
def knocked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A dashboard on a drive whose camera is rotated relative to its calibration."""
    scene = tmp_path_factory.mktemp("scene") / "knocked.yaml"
    scene.write_text(SCENE)
    engine = Engine(open_source, CountedDetector, Params(), uri=f"sim:{scene}")
    with serving(engine) as site:
        engine.control.change(playing=False, target=FRAME, steps=0)
        engine.wait_for(lambda s: s.processed is not None and s.index == FRAME and not s.playing, WAIT_S)
        yield site


@pytest.fixture(autouse=True)
def as_delivered(knocked: Site) -> None:
    knocked.engine.control.set_params(Params(), "default")
    knocked.engine.wait_for(lambda s: s.params == Params(), WAIT_S)


def by_mouse(canvas: Locator, x: float, y: float) -> None:
    canvas.click(position={"x": x, "y": y})


def by_finger(canvas: Locator, x: float, y: float) -> None:
    canvas.tap(position={"x": x, "y": y})


class Hand:
    """Presses points of the shown frame, and the pixels where the turned camera sees them."""

    def __init__(self, page: Page, site: Site, press: Press = by_mouse) -> None:
        processed = site.engine.snapshot.processed
        assert processed is not None
        camera = processed.frame.camera
        assert camera is not None
        self._canvas, self._press, self._size = page.locator("#camera"), press, (camera.width, camera.height)
        self._objects, self._present = processed.result.objects, resolve(Params().alignment, camera)
        points = processed.result.layers.points[:, :3].astype(np.float64)
        points = points[(points[:, 0] > 6.0) & (np.hypot(points[:, 0], points[:, 1]) < 40.0)]
        shown, true = (
            resolve(with_changes(Params(), changes).alignment, camera).project(points) for changes in ({}, TURNED)
        )
        inside = np.all([(uv > 30.0) & (uv < np.array(self._size) - 30.0) for uv in (shown, true)], axis=(0, 2))
        self._shown, self._true = shown[inside], true[inside]

    def spread(self, count: int) -> list[int]:
        """Points far from each other in the image."""
        chosen = [int(np.argmin(self._shown[:, 0]))]
        while len(chosen) < count:
            away = np.linalg.norm(self._shown[:, None] - self._shown[chosen], axis=2).min(axis=1)
            chosen.append(int(np.argmax(away)))
        return chosen

    def pick(self, point: int) -> None:
        self._at(self._shown[point])

    def place(self, point: int, by_px: tuple[float, float] = (0.0, 0.0)) -> None:
        self._at(self._true[point] + by_px)

    def pick_cluster(self) -> None:
        """Of the nearest vehicle ahead."""
        item = next(each for each in self._objects if each.source == "VL" and each.cuboid is not None)
        assert item.cuboid is not None
        assert self._present is not None
        self._at(self._present.project(np.array([item.cuboid.center]))[0])

    def sky(self) -> None:
        self._at(np.array([self._size[0] / 2.0, 8.0]))

    def _at(self, pixel: F64) -> None:
        box = self._canvas.bounding_box()
        assert box is not None
        scale = min(box["width"] / self._size[0], box["height"] / self._size[1])
        left, top = (box["width"] - self._size[0] * scale) / 2, (box["height"] - self._size[1] * scale) / 2
        self._press(self._canvas, float(left + pixel[0] * scale), float(top + pixel[1] * scale))


def begun(page: Page) -> Locator:
    """Alignment by pairs, and its pane."""
    page.keyboard.press("a")
    page.locator("#align-bar").get_by_role("button", name="Pairs", exact=True).click()
    return page.locator("#pair-pane")


def test_pairs_are_picked_checked_undone_and_their_fit_applied(pages: Pages, knocked: Site):
    with opening(pages, knocked) as begin:
        page = begin(1280, 720)
        pane, hand = begun(page), Hand(page, knocked)
        expect(page.locator(".ranges")).not_to_be_empty()
        step, rows, apply = pane.get_by_role("status"), pane.locator("li[data-wrong]"), pane.get_by_text("Apply")
        expect(step).to_have_text("Press a LiDAR point, then the pixel where it belongs.")
        hand.sky()
        expect(step).to_have_text("No LiDAR point here: press nearer to one.")
        first, *others, last = hand.spread(6)

        canvas, at_first = page.locator("#camera"), page.locator("#camera").bounding_box()
        hand.pick(first)
        expect(step).to_have_text(re.compile(r"Point at \d+\.\d m\. Now press where it belongs"))
        assert canvas.bounding_box() == at_first, "the image stays where it is between two presses"
        page.keyboard.press("Escape")
        expect(step).to_have_text("Press a LiDAR point, then the pixel where it belongs.")
        hand.pick(first)
        hand.place(first)
        expect(rows).to_have_count(1)
        expect(pane).to_contain_text("No fit: 2 pairs are needed; 1 more")
        expect(apply).to_be_disabled()

        for number, point in enumerate(others, 2):
            hand.pick(point)
            hand.place(point)
            expect(rows).to_have_count(number)
        expect(pane).to_contain_text(re.compile(r"yaw\d\.\d\d° ± 0\.\d\d°.*roll"))
        expect(pane).to_contain_text(re.compile(r"\d+\.\d px → \d\.\d px from their pixels"))
        hand.pick(last)
        hand.place(last, by_px=(60.0, -30.0))
        expect(pane).to_contain_text(re.compile(r"pair 6 contradicts the others by \d+ px"))
        expect(rows.nth(5)).to_have_attribute("data-wrong", "yes")
        page.keyboard.press("Control+z")
        expect(rows).to_have_count(5)
        pane.get_by_role("button", name="Remove pair 2").click()
        expect(rows).to_have_count(4)
        pane.get_by_role("button", name="Undo pair").click()
        expect(rows).to_have_count(5)
        expect(pane).to_contain_text("of 5 pairs")
        assert knocked.engine.control.peek().params == Params(), "nothing changes before Apply"

        apply.click()
        found = knocked.engine.wait_for(lambda s: s.params != Params(), WAIT_S).params.alignment
        assert found.yaw_deg == pytest.approx(2.0, abs=0.15)
        assert found.pitch_deg == pytest.approx(-1.5, abs=0.15)
        expect(rows.first).to_have_text(re.compile(r"(\d\.\d px) → \1"))
        page.locator("#align-bar").get_by_role("button", name="Versions").click()
        expect(page.get_by_label("Saved alignments")).to_contain_text("5 pairs picked by hand")
        page.keyboard.press("Control+z")
        knocked.engine.wait_for(lambda s: s.params == Params(), WAIT_S)
        expect(rows).to_have_count(5)
        page.locator("#align-bar").get_by_role("button", name="Pairs", exact=True).click()
        expect(pane).to_be_hidden()
        expect(page.locator("[data-param='alignment.yaw_deg'] input[type=range]")).to_be_in_viewport(ratio=1.0)


def test_a_finger_picks_points_and_clusters_and_zooms_no_roll(pages: Pages, knocked: Site):
    with opening(pages, knocked) as begin:
        page = begin(1280, 720, color_scheme="light", has_touch=True)
        pane, hand = begun(page), Hand(page, knocked, by_finger)
        step, rows = pane.get_by_role("status"), pane.locator("li[data-wrong]")
        for number, point in enumerate(hand.spread(4), 1):
            hand.pick(point)
            expect(step).to_contain_text("Now press where it belongs")
            hand.place(point)
            expect(rows).to_have_count(number)
        expect(pane).to_contain_text(re.compile(r"yaw[12]\.\d\d° ±"))
        pane.get_by_role("button", name="Cluster").tap()
        expect(step).to_have_text("Press a vehicle's LiDAR points for another pair.")
        hand.pick_cluster()
        expect(step).to_have_text(re.compile(r"Object at \d+\.\d m\. Now press the middle of its lower edge"))
        apply = pane.get_by_role("button", name="Apply")
        expect(apply).to_be_in_viewport(ratio=1.0)
        page.mouse.move(400, 350)
        page.mouse.wheel(0, -300)
        assert knocked.engine.control.peek().params == Params(), "the wheel zooms here"
        page.locator("#align-bar").get_by_role("button", name="Pairs", exact=True).tap()
        expect(pane).to_be_hidden()
