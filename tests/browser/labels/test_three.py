"""The 3D view while labeling, as the browser draws it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from playwright.sync_api import WebSocket, expect

from app.core.shared_view_state import SharedViewState
from app.views.lazy_scene import LateScene
from tests.browser.conftest import START, Pages, Site, opening
from tests.browser.labels.hands import Labels, begin, draw, is_at
from tests.browser.looks import COUNT

OF_VISER = ("THREE.Clock", "unsafe-eval", "GL Driver Message", "WebGL")
"""What viser's own page says."""
pytestmark = pytest.mark.usefixtures("paused_in_traffic")


@pytest.fixture
def three(site: Site) -> Iterator[Site]:
    """A second server for the same engine, with a 3D view."""
    looks = SharedViewState()
    with LateScene(site.engine, looks) as scene:
        running = Site(site.engine, 0, looks=looks, scene=scene)
        running.start()
        yield running
        running.stop()


def test_the_camera_goes_to_the_selection_and_visers_own_panel_stays_away(pages: Pages, three: Site) -> None:
    cameras: list[dict[str, Any]] = []

    def listen(socket: WebSocket) -> None:
        socket.on("framesent", lambda payload: cameras.extend(cameras_in(payload)))

    with opening(pages, three) as open_page:
        page = open_page(address=three.address, expects=OF_VISER, locale="en")  # a locale: a page of its own
        page.on("websocket", listen)
        labels, hand = Labels(page, three.address), begin(page)
        labels.clear(COUNT)
        page.evaluate("async (index) => (await import('/js/drive/seek.js')).seekTo(index)", START)
        is_at(page, START)
        made = draw(hand, labels)
        hand.keys("Escape")
        page.get_by_role("tab", name="3D").click()
        scene = page.frame_locator("#three-body iframe")
        expect(scene.get_by_text("CIPV Studio", exact=True)).to_be_visible()
        expect(scene.get_by_text("Parameters", exact=True), "the panel is folded up").to_be_hidden()
        viser = next(frame for frame in page.frames if "/viser/of/" in frame.url)
        expect(scene.locator("#webgl-software-rendering")).to_be_attached()
        expect(scene.locator("#webgl-software-rendering"), "this page says it in its own words").to_be_hidden()
        page.get_by_role("button", name="Close this note").click()
        expect(page.get_by_text("drawn without a graphics card")).to_have_count(0)
        assert page.evaluate("document.activeElement.tagName") != "IFRAME"
        assert viser.evaluate("document.hasFocus()"), "without it, viser does not connect again after a loss"
        middle = labels.cuboid(made, START)["center"]
        labels.wait_for(lambda _: cameras != [])
        assert not is_on(cameras[-1], middle)
        page.locator(f".track-row[data-id='{made}']").click()
        labels.wait_for(lambda _: is_on(cameras[-1], middle))
        assert math.dist(cameras[-1]["position"], middle) < 15.0, "near by"


def test_a_page_in_the_3d_view_is_moved_by_nobody_and_moves_nobody(pages: Pages, three: Site) -> None:
    with opening(pages, three) as open_page:
        mine, other = (open_page(address=three.address, expects=OF_VISER, locale=each) for each in ("en", "en-GB"))
        for page, person in ((mine, "Ada"), (other, "Bob")):
            begin(page, person)
            page.get_by_role("tab", name="3D").click()
            is_at(page, START)
        other.keyboard.press("Home")
        is_at(other, 0)
        other.keyboard.press("ArrowRight")
        is_at(other, 1)
        is_at(mine, START)
        assert three.engine.snapshot.index == START, "nor those who watch"
        assert three.looks is not None
        three.engine.control.change(target=7)
        three.engine.wait_for(lambda now: now.index == 7, 60)
        mine.keyboard.press("ArrowRight")
        is_at(mine, START + 1)
        is_at(other, 1)


def cameras_in(payload: str | bytes) -> list[dict[str, Any]]:
    """What viser's page tells its server of where it looks."""
    said = msgspec.msgpack.decode(payload) if isinstance(payload, bytes) else []
    every = said if isinstance(said, list) else [said]
    return [each for each in every if isinstance(each, dict) and each.get("type") == "ViewerCameraMessage"]


def is_on(camera: dict[str, Any], place: list[float]) -> bool:
    return math.dist(camera["look_at"], place) < 0.1
