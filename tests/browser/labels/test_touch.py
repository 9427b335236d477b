"""Two fingers on a touch screen zoom the image, and neither select nor draw anything."""

from __future__ import annotations

import pytest

from tests.browser.labels.hands import Hand, Labels, draw
from tests.browser.looks import box_of

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

SHOWN = """async () => {
  const { place } = await import('/js/views/camera.js'), { get } = await import('/js/core/store.js');
  const { x, y, scale } = place();
  return { x, y, scale: scale * get('frame').image.scale };
}"""
"""Position of the camera's image, and canvas pixels per camera pixel: the image is sent larger once it is zoomed."""


def test_two_fingers_zoom_into_the_image_where_they_are(hand: Hand, labels: Labels) -> None:
    page = hand.page
    draw(hand, labels)
    devtools = page.context.new_cdp_session(page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})

    def pinch(x: float, y: float, *apart_px: float) -> None:
        """Two fingers around a position of the pane, from the first distance to the last."""
        left, top = box["x"] + x, box["y"] + y
        touch("touchStart", (left - apart_px[0], top))
        touch("touchStart", (left - apart_px[0], top), (left + apart_px[0], top))
        for apart in apart_px[1:]:
            touch("touchMove", (left - apart, top), (left + apart, top))
        touch("touchEnd")

    box, whole = box_of(page.locator("#camera")), page.evaluate(SHOWN)
    pinch(box["width"] / 2, box["height"] / 2, 20, 30, 40, 60)
    before = page.evaluate(SHOWN)
    assert before["scale"] == pytest.approx(3 * whole["scale"], rel=0.05)
    x, y = box["width"] * 0.4, box["height"] * 0.55
    pinch(x, y, 30, 40, 60)
    after = page.evaluate(SHOWN)
    assert after["scale"] == pytest.approx(2 * before["scale"], rel=0.05)
    pixels = [((x - at["x"]) / at["scale"], (y - at["y"]) / at["scale"]) for at in (before, after)]
    assert pixels[1] == pytest.approx(pixels[0], abs=3.0), "the same pixel stays between the fingers"
    pinch(x, y, 120, 60, 10)
    pinch(x, y, 120, 60, 10)
    assert page.evaluate(SHOWN)["scale"] == pytest.approx(whole["scale"], rel=0.01), "and out again"
    assert len(labels.tracks) == 1
