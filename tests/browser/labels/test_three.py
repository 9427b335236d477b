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
        middle = labels.cuboid(made, START)["center"]
        labels.wait_for(lambda _: cameras != [])
        assert not is_on(cameras[-1], middle)
        page.locator(f".track-row[data-id='{made}']").click()
        labels.wait_for(lambda _: is_on(cameras[-1], middle))
        assert math.dist(cameras[-1]["position"], middle) < 15.0, "near by"


def test_the_recording_stops_at_the_frame_of_the_page_that_opens_the_3d_view(pages: Pages, three: Site) -> None:
    with opening(pages, three) as open_page:
        page = open_page(address=three.address, expects=OF_VISER, locale="en")
        begin(page)
        page.evaluate("async () => (await import('/js/drive/seek.js')).seekTo(7)")
        is_at(page, 7)
        three.engine.control.change(playing=True)
        three.engine.wait_for(lambda now: now.playing, 60)
        page.get_by_role("tab", name="3D").click()
        three.engine.wait_for(lambda now: not now.playing and now.index == 7, 60)
        is_at(page, 7)


def cameras_in(payload: str | bytes) -> list[dict[str, Any]]:
    """What viser's page tells its server of where it looks."""
    said = msgspec.msgpack.decode(payload) if isinstance(payload, bytes) else []
    every = said if isinstance(said, list) else [said]
    return [each for each in every if isinstance(each, dict) and each.get("type") == "ViewerCameraMessage"]


def is_on(camera: dict[str, Any], place: list[float]) -> bool:
    return math.dist(camera["look_at"], place) < 0.1
