"""What matters is seen: sensors, figures, whatever ACC reacts to, by day and by night."""

from __future__ import annotations

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from pipeline.types import Result
from tests.browser.conftest import OpenPage, Site
from tests.browser.display.conftest import WAIT_S, OpenDisplay, is_now, keep
from tests.browser.judges import LOW_CONTRAST
from tests.browser.looks import settle, show_instead

SIZES = [(1024, 600), (1280, 800), (800, 480), (720, 450), (390, 844)]
FINGER_PX = 48

STREAMS = """async () => {
  const { get, set } = await import("/js/core/store.js");
  const stream = (state, rate_hz) => ({ state, rate_hz, age_ms: 10, jitter_ms: 1, lost: 0, note: "" });
  const streams = { lidar: stream("ok", 10), camera: stream("stale", 5), gnss: stream("silent", null) };
  set("state", { ...get("state"), streams });
  return [...document.querySelectorAll("#sensors li")].map((one) =>
    [one.textContent, getComputedStyle(one).color, one.querySelector("path").getAttribute("d")]);
}"""
"""The states of a sensor that works, one that is late and one that is silent."""


@pytest.mark.usefixtures("paused_in_traffic")
def test_a_sensor_that_fails_is_seen_by_colour_word_and_shape(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    expect(page.locator("#sensors li")).to_have_count(3)
    works, late, own_speed, gone = page.evaluate(STREAMS)
    assert [works[0], late[0], own_speed[0], gone[0]] == ["LiDAR10 Hz", "Camerastale", "Ego speed", "GNSSsilent"]
    for column in (1, 2):
        assert len({works[column], late[column], gone[column]}) == 3


@pytest.mark.usefixtures("paused_in_traffic")
def test_a_further_sensor_is_named(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    expect(page.locator("#sensors li")).to_have_count(3)
    # again and again: the server may send the same frame once more
    page.wait_for_function(
        """async () => {
          const { get, set } = await import("/js/core/store.js");
          const frame = get("frame"), { result } = frame;
          const sensors = { ...result.sensors, radar: { age_ms: 0, points: 3 } };
          set("frame", { ...frame, result: { ...result, sensors } });
          await new Promise(requestAnimationFrame);
          const names = [...document.querySelectorAll("#sensors li")].map((item) => item.textContent.trim());
          return names.join() === "LiDAR,Camera,Ego speed,Radar";
        }"""
    )


CUT_OFF = """() => {
  const { right } = document.querySelector(".lead").getBoundingClientRect();
  const isBroken = (node) => node.getBoundingClientRect().height > 1.6 * parseFloat(getComputedStyle(node).fontSize);
  return [...document.querySelectorAll(".figure small, .ttc b")]
    .filter((node) => node.getBoundingClientRect().right > right || (node.matches("b") && isBroken(node)))
    .map((node) => node.textContent);
}"""
"""Units that large numbers have pushed out of view or into another line."""

OVERLAPS = """() => {
  const parts = ["#acc-word", "#acc-reason", ".speeds", ".lead", ".road", ".plan", "#sensors", "#night", "#record",
    "#mark"].map((one) => [one, document.querySelector(one)]);
  const box = (node) => {
    const range = document.createRange();
    range.selectNodeContents(node);
    return (node.matches("strong, span") ? range : node).getBoundingClientRect();
  };
  const inside = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left);
  const over = (a, b) => Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
  return parts.flatMap(([a, one], place) => parts.slice(place + 1)
    .filter(([, other]) => inside(box(one), box(other)) > 8 && over(box(one), box(other)) > 8)
    .map(([b]) => `${a} ${b}`));
}"""
"""Parts of the display that lie on each other, by more than the empty edges of letters."""
LEAST_ROAD_PX = 200
"""Width of a camera image in which a car ahead can be made out."""


@pytest.mark.usefixtures("paused_in_traffic")
def test_it_fits_a_finger_finds_it_and_it_can_be_read(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    is_now(page, "paused")
    distance = page.locator("#distance")
    shown = distance.inner_text()
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            is_now(page, "paused")
            expect(page.locator("#sensors li")).to_have_count(3)
            expect(distance).to_have_text(shown)
            keep(page, f"drive_{width}x{height}_{scheme}")
            assert page.evaluate(LOW_CONTRAST) == []
        assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
            width,
            height,
        ]
        assert page.evaluate(OVERLAPS) == []
        assert page.evaluate("document.querySelector('.road').clientWidth") > LEAST_ROAD_PX
        targets = page.eval_on_selector_all("button", "all => all.map((node) => node.getBoundingClientRect().toJSON())")
        assert len(targets) == 3
        for box in targets:
            assert min(box["width"], box["height"]) >= FINGER_PX
            assert box["right"] <= width
            assert box["bottom"] <= height
        page.locator("#ttc-value").evaluate("(node) => (node.textContent = '> 99 s')")
        for words in ("0.0", "188", "88.8", shown):  # the widest; then its own again, for the next images
            distance.evaluate("(node, words) => (node.textContent = words)", words)
            assert page.evaluate(CUT_OFF) == []


@pytest.mark.usefixtures("paused_in_traffic")
def test_the_dashboards_help_leads_there(open_page: OpenPage, site: Site):
    page = open_page()
    page.keyboard.press("?")
    page.get_by_role("link", name="Display").click()
    expect(page).to_have_url(f"{site.address}/drive/")
    is_now(page, "paused")


def _is_closing(result: Result) -> bool:
    return result.cipv is not None and result.cipv.closing_speed_mps is not None


@pytest.mark.usefixtures("paused_in_traffic")
def test_the_figures_are_those_of_the_result(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    # a frame that was sought is shown at once, and again when the frames before it have been run
    site.engine.wait_for(lambda s: s.processed is not None and _is_closing(s.processed.result), WAIT_S)
    result = httpx.get(f"{site.address}/api/result", timeout=WAIT_S).json()
    lead = result["cipv"]
    digits = 1 if lead["distance_m"] < 20 else 0
    expect(page.locator("#distance")).to_have_text(f"{lead['distance_m']:.{digits}f}")
    expect(page.locator("#closing")).to_have_text(f"{abs(lead['closing_speed_mps'] * 3.6):.0f}")
    expect(page.locator("#own-speed")).to_have_text(f"{result['ego']['speed_mps'] * 3.6:.0f}")
    expect(page.locator("#acc")).to_have_attribute("data-state", result["acc"]["state"])


def show_command(page: Page, **command: str | int) -> None:
    """Another command of ACC with the shown frame."""
    show_instead(page, frame={"result": {"acc": command}})
    settle(page)


TOLD = """() => {
  const reason = document.querySelector("#acc-reason");
  return {
    whole: reason.scrollHeight <= reason.clientHeight && reason.scrollWidth <= reason.clientWidth,
    top: document.querySelector(".data").getBoundingClientRect().top,
  };
}"""
"""Whether ACC's reason is seen to its end, and where the rest of the display begins."""


@pytest.mark.usefixtures("paused_in_traffic")
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_what_acc_does_not_do_is_told_to_its_end_without_moving_the_rest(
    open_display: OpenDisplay, site: Site, width: int, height: int
):
    page = open_display(site.address, width, height)
    is_now(page, "paused")
    told = []
    for reason in ("free road", "camera and LiDAR disagree about where cars are: ACC will not accelerate"):
        show_command(page, state="cruise", reason=reason)
        told.append(page.evaluate(TOLD))
    assert [each["whole"] for each in told] == [True, True]
    assert told[0]["top"] == told[1]["top"]


ALARM_PIXELS = """(selector) => {
  const canvas = document.querySelector(selector), ctx = canvas.getContext("2d");
  const { data } = ctx.getImageData(0, 0, canvas.width, canvas.height);
  let found = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b, a] = data.subarray(i, i + 4);
    found += r > 230 && g < 110 && b < 110 && a > 200;
  }
  return found;
}"""


@pytest.mark.usefixtures("paused_in_traffic")
def test_whatever_acc_reacts_to_is_drawn_also_when_it_is_not_the_lead(open_display: OpenDisplay, site: Site):
    page = open_display(site.address, color_scheme="light")
    is_now(page, "paused")
    result = httpx.get(f"{site.address}/api/result", timeout=WAIT_S).json()
    other = next(o for o in result["objects"] if o["bev"] and o["id"] != result["cipv"]["id"] and o["distance_m"] < 60)
    assert page.evaluate(ALARM_PIXELS, "#plan") == 0
    show_command(page, state="warn", reason=f"would hit #{other['id']} in 1.9 s", object_id=other["id"])
    assert page.evaluate(ALARM_PIXELS, "#plan") > 20
    expect(page.locator("#acc-reason")).to_contain_text(f"would hit #{other['id']}")
    show_command(page, state="warn", reason="it is not here any more", object_id=987654)
    assert page.evaluate(ALARM_PIXELS, "#plan") == 0


@pytest.mark.usefixtures("paused_in_traffic")
def test_warning_and_braking_differ_in_colour_word_and_shape(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    is_now(page, "paused")
    looks = set()
    for state in ("follow", "warn", "full_brake"):
        show_command(page, state=state, reason=f"for a test of {state}")
        looks.add(
            page.evaluate(
                "() => [getComputedStyle(document.querySelector('#acc')).backgroundColor, "
                "document.querySelector('#acc-word').textContent, "
                "document.querySelector('#acc-shape path').getAttribute('d')].join('|')"
            )
        )
        keep(page, f"drive_{state}")
    colours, words, shapes = (set(column) for column in zip(*(look.split("|") for look in looks), strict=True))
    assert (len(colours), len(words), len(shapes)) == (3, 3, 3)


def brightness(page: Page) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image


@pytest.mark.usefixtures("paused_in_traffic")
def test_night_is_dim_follows_the_system_and_remembers_the_hand(open_display: OpenDisplay, site: Site):
    page = open_display(site.address, color_scheme="dark")
    is_now(page, "paused")
    night = page.locator("#night")
    expect(night).to_have_attribute("aria-pressed", "true")
    dark = brightness(page)
    assert dark.mean() < 60
    assert (dark > 210).mean() < 0.01, "no large white"
    page.emulate_media(color_scheme="light")
    expect(night).to_have_attribute("aria-pressed", "false")
    assert brightness(page).mean() > 120
    night.tap()
    expect(night).to_have_attribute("aria-pressed", "true")
    page.reload()
    is_now(page, "paused")
    expect(night).to_have_attribute("aria-pressed", "true")
    assert brightness(page).mean() < 60
