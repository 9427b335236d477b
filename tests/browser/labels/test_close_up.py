"""Seen from close by: the image zoomed to single pixels, three views of the selection, a track as a filmstrip."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import START
from tests.browser.labels.hands import LEAD_X, Hand, Labels, draw, is_at, is_saved
from tests.browser.looks import box_of, pixels, repainted

pytestmark = pytest.mark.usefixtures("paused_in_traffic")
SCREENS = Path(__file__).resolve().parents[3] / "build" / "screens"
CAR = {"center": [LEAD_X, 0.0, 0.1], "size": [4.4, 1.8, 1.5], "yaw_rad": 0.0}
SOON_MS = 30_000
LOADED = "(image) => image.complete && image.naturalWidth > 0"


def canvas_per_pixel(page: Page) -> float:
    """Size of a camera pixel on the canvas."""
    return page.evaluate(
        """async () => {
          const { place } = await import("/js/views/camera.js"), { get } = await import("/js/core/store.js");
          return place().scale * (get("frame").image.scale ?? 1);
        }"""
    )


def whole(page: Page) -> None:
    """Zoom out completely."""
    for _ in range(14):
        page.keyboard.press("<")


def tags(page: Page) -> set[str]:
    """Which of a bus and the selected label have a name tag in the part of the image that is in view."""
    drawn = page.evaluate(
        """async () => {
          const canvas = document.querySelector("#camera"), drawn = [], own = canvas.getContext("2d");
          own.fillText = (words, x, y) => {
            if (y > 0 && y < canvas.clientHeight) drawn.push(words);
            CanvasRenderingContext2D.prototype.fillText.call(own, words, x, y);
          };
          const { get, set } = await import("/js/core/store.js");
          set("layers", { ...get("layers") });
          await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
          delete own.fillText;
          return drawn;
        }"""
    )
    names = [words.split() for words in drawn]
    return {"bus" for words in names if words[1:2] == ["bus"]} | {words[0] for words in names if words[1:2] == ["car"]}


def test_the_image_is_zoomed_by_keys_wheel_and_fingers_to_single_pixels(hand: Hand, labels: Labels):
    page = hand.page
    beside = {**CAR, "center": [LEAD_X, 6.0, 0.1]}
    labels.act("Ada", {"kind": "add_track", "label": "bus", "frame": START, "cuboid": beside, "bbox": None})
    made = draw(hand, labels)
    is_saved(page)
    whole(page)
    least, shown = canvas_per_pixel(page), pixels(page, "#camera")
    assert tags(page) == {"bus", f"#{made}"}
    for _ in range(6):
        page.keyboard.press(">")
    assert tags(page) == {f"#{made}"}, "of what is in view"
    for _ in range(8):
        page.keyboard.press(">")
    assert canvas_per_pixel(page) > 10, "a pixel of the camera is many of the page"
    assert repainted(page, "#camera", shown)
    whole(page)
    assert canvas_per_pixel(page) == pytest.approx(least)

    box = box_of(page.locator("#camera"))
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*middle)
    page.mouse.wheel(0, -600)
    page.wait_for_function("async () => (await import('/js/views/image_zoom.js')).isZoomed()")
    whole(page)

    def finger(kind: str, number: int, dx: float) -> None:
        x, y = box["width"] / 2 + dx, box["height"] / 2
        page.locator("#camera").evaluate(
            """(canvas, [kind, number, x, y]) => {
              const { left, top } = canvas.getBoundingClientRect();
              const at = { pointerId: number, pointerType: "touch", isPrimary: number === 31, bubbles: true };
              canvas.setPointerCapture = () => {};
              canvas.dispatchEvent(new PointerEvent(kind, { ...at, clientX: left + x, clientY: top + y }));
              delete canvas.setPointerCapture;
            }""",
            [kind, number, x, y],
        )

    before = len(labels.tracks)
    finger("pointerdown", 31, -20)
    finger("pointerdown", 32, 20)
    finger("pointermove", 32, 60)
    finger("pointermove", 31, -60)
    for number in (31, 32):
        finger("pointerup", number, 0)
    assert canvas_per_pixel(page) == pytest.approx(3 * least, rel=0.05), "three times as far apart"
    assert len(labels.tracks) == before, "two fingers draw nothing"
    whole(page)


def test_the_selection_is_seen_from_three_sides_and_renewed_when_it_moves(hand: Hand, labels: Labels):
    page = hand.page
    draw(hand, labels)
    is_saved(page)
    close = page.locator("img.close-up")
    expect(close).to_be_visible()
    page.wait_for_function(f"() => ({LOADED})(document.querySelector('img.close-up'))")
    before = close.get_attribute("src")
    hand.keys("ArrowUp")
    is_saved(page)
    expect(close).not_to_have_attribute("src", before or "")
    answer = page.request.get(f"{page.url.split('?')[0].rstrip('/')}/{close.get_attribute('src')}")
    assert (answer.status, answer.headers["content-type"]) == (200, "image/jpeg")
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / "close_up.png")


def test_review_shows_a_track_as_a_filmstrip_and_a_press_goes_there(hand: Hand, labels: Labels):
    page = hand.page
    added = labels.act("Bob", {"kind": "add_track", "label": "car", "frame": START - 4, "cuboid": CAR, "bbox": None})
    (track,) = added["changed"]["tracks"]
    later = {"kind": "set_sighting", "track": track["id"], "revision": track["revision"], "frame": START + 4}
    labels.act("Bob", later | {"cuboid": CAR, "bbox": None, "interpolate": True})
    hand.keys("Shift+R")
    stills = page.locator(".filmstrip button")
    expect(stills.first).to_be_visible()
    frames = [int(each) for each in stills.evaluate_all("(all) => all.map((one) => one.dataset.frame)")]
    assert frames == sorted(frames)
    assert {START - 4, START + 4} < set(frames), "its ends, and frames between them that fit worst"
    expect(page.locator(".filmstrip [data-why='fits worst']").first).to_be_visible()
    detail = page.locator(".track-detail")
    assert detail.evaluate("(pane) => pane.scrollWidth <= pane.clientWidth"), "both columns of the strip are seen"
    page.locator(f".filmstrip [data-frame='{START + 4}']").click()
    is_at(page, START + 4)
    expect(page.locator(f".filmstrip [data-frame='{START + 4}']")).to_have_class("is-here")
    hand.keys("Escape")
    expect(page.locator(".filmstrip")).to_be_hidden()


def test_the_selected_row_is_in_view_and_the_mode_survives_a_reload(hand: Hand, labels: Labels):
    page = hand.page
    made = []
    for number in range(30):
        cuboid = CAR | {"center": [12.0 + 2 * number, 5.0, 0.1]}
        added = labels.act("Bob", {"kind": "add_track", "label": "car", "frame": START, "cuboid": cuboid, "bbox": None})
        made.append(added["changed"]["tracks"][0]["id"])
    expect(page.locator(".track-row")).to_have_count(30)
    for _ in range(2):
        hand.keys(",")
    selected = page.locator(".track-row[aria-selected=true]")
    expect(selected).to_have_attribute("data-id", str(made[-2]))
    expect(selected).to_be_in_viewport(timeout=SOON_MS)  # later, the detail pane may have brought it
    page.set_viewport_size({"width": 1280, "height": 720})
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / "labeling_30_vehicles.png")
    page.reload()
    expect(page.locator("#label-pane")).to_be_visible()
    is_at(page, START)
    expect(page.locator("#label-bar")).to_contain_text("Ada")


def test_what_is_implausible_is_listed_as_one_labels_and_a_press_goes_there(hand: Hand, labels: Labels):
    page = hand.page
    page.get_by_role("tab", name="Checks").click()
    listed = page.locator("#label-checks")
    expect(listed).to_contain_text("Nothing to check yet")
    made = []
    for aside_m in (0.0, 0.5):
        cuboid = CAR | {"center": [LEAD_X, aside_m, 0.1]}
        new = {"kind": "add_track", "label": "car", "frame": START + 5, "cuboid": cuboid, "bbox": None}
        made.append(labels.act("Bob", new)["changed"]["tracks"][0])
    row = listed.get_by_role("button", name="overlap")
    expect(row).to_contain_text(f"#{made[0]['id']} car and #{made[1]['id']} car overlap")
    expect(row, "a longer sentence is not cut off").to_have_css("white-space", "normal")
    row.click()
    is_at(page, START + 5)
    hand.keys("Shift+Delete")
    labels.wait_for(lambda now: set(now.tracks) == {made[1]["id"]})
    expect(row).to_have_count(0)
    expect(listed).to_contain_text("No problems found")
