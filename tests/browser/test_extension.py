"""What a contributor adds appears in the page: a lane of the timeline, a layer of the camera, a sensor's objects."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.looks import box_of, show_instead, wait_for_frame, whole_drive

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

ADD_LANE = """async (before) => {
  const { addLane } = await import("/js/timeline/lanes/registry.js");
  window.drawn = [];
  window.clicked = [];
  addLane({
    key: "object-count",
    height: () => 18,
    draw(ctx, { span, row }) {
      window.drawn.push({ ...row });
      ctx.fillStyle = "rgb(255, 0, 255)";
      ctx.fillRect(span.left, row.top, span.width, row.height);
    },
    label: (index) => ({ name: "objects", value: String(index), tint: "rgb(255, 0, 255)" }),
    click: (span, x) => window.clicked.push(span.index(x)),
  }, before);
}"""

MAGENTA_ROWS = """() => {
  const canvas = document.querySelector("#timeline-back");
  const { data } = canvas.getContext("2d").getImageData(canvas.width / 2, 0, 1, canvas.height);
  return Array.from({ length: canvas.height }, (_, y) => y)
    .filter((y) => data[4 * y] === 255 && data[4 * y + 1] === 0 && data[4 * y + 2] === 255).length;
}"""


@pytest.mark.parametrize("before", ["lead", None])
def test_a_lane_is_added_by_one_call(open_page: OpenPage, site: Site, before: str | None) -> None:
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    assert page.evaluate(MAGENTA_ROWS) == 0
    page.evaluate(ADD_LANE, before)
    page.wait_for_function("() => window.drawn.length > 0")
    assert page.evaluate(MAGENTA_ROWS) == pytest.approx(18, abs=2), "drawn over its whole height, and no further"
    row = page.evaluate("window.drawn.at(-1)")
    front = page.locator("#timeline-front")
    front.click(position={"x": box_of(front)["width"] / 2, "y": row["top"] + row["height"] / 2})
    page.wait_for_function("() => window.clicked.length === 1")


def test_a_camera_layer_is_added_by_one_call(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_frame(page, START)
    page.evaluate(
        """async () => {
          const { addLayer } = await import("/js/views/camera.js"), { set, get } = await import("/js/core/store.js");
          addLayer((ctx, frame, place) => (window.layer = { frame: frame.state.index, scale: place.scale }), "over");
          set("layers", { ...get("layers") });
        }"""
    )
    page.wait_for_function("() => window.layer !== undefined")
    assert page.evaluate("window.layer.frame") == START
    assert page.evaluate("window.layer.scale") > 0


def test_objects_of_a_further_sensor_are_shown_by_letter_and_colour(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_frame(page, START)
    first, second, *rest = page.evaluate("async () => (await import('/js/core/store.js')).get('frame').result.objects")
    objects = [first | {"source": "VR"}, second | {"source": "R"}, *rest]
    show_instead(page, frame={"result": {"objects": objects}})
    expect(page.locator("#object-facts")).to_contain_text("1 VR · 1 R")
    for source, role in (("VR", "fused"), ("R", "lidar")):
        expect(page.locator("#objects .pill").get_by_text(source, exact=True)).to_have_attribute("data-role", role)


def test_help_opens_in_a_new_tab(open_page: OpenPage) -> None:
    page = open_page()
    for place in ("#help-link", "#help-dialog a[href='help/']"):
        if place.startswith("#help-dialog"):
            page.keyboard.press("?")
        link = page.locator(place)
        assert link.is_visible()
        assert (link.get_attribute("href"), link.get_attribute("target")) == ("help/", "_blank")
