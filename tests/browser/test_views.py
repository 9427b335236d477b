"""Camera and plan: what is drawn, coloured, measured and picked there."""

from __future__ import annotations

import json
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from app.streaming.sent_image import WIDTH_STEP_PX
from tests.browser.conftest import START, OpenPage, Site
from tests.browser.looks import box_of, pixels, repainted, settle, show_instead, wait_for_frame, whole_drive

pytestmark = pytest.mark.usefixtures("paused_in_traffic")

COLOURS = ("object", "range", "height", "intensity", "ring", "cluster", "ground")
"""``age`` needs a recording that says when each point was measured."""
HOLD_PX = 24
"""Maximum distance of a tape's end from where it was set, since it snaps to the nearest point."""
AHEAD_M, FROM_M, HALF_WIDTH_M, TOOLS_PX = 79.0, -5.0, 13.0, 36
"""Initial extent of the plan (viewport.js)."""


def of_store(page: Page, words: str) -> Any:
    """A value from the page's state: ``words`` is an expression of ``get``."""
    return page.evaluate(f"async () => {{ const {{ get }} = await import('/js/core/store.js'); return {words}; }}")


def on_plan(page: Page, x_m: float, y_m: float) -> tuple[float, float]:
    """Screen position of a position in the fitted plan."""
    box = box_of(page.locator("#bev"))
    per_metre = min((box["height"] - TOOLS_PX) / AHEAD_M, box["width"] / (2 * HALF_WIDTH_M))
    return box["x"] + box["width"] / 2 - y_m * per_metre, box["y"] + box["height"] - TOOLS_PX - (
        x_m - FROM_M
    ) * per_metre


def in_image(page: Page, u: float, v: float) -> tuple[float, float]:
    """Screen position of a pixel of the sent image."""
    box = box_of(page.locator("#camera"))
    place = page.evaluate("async () => (await import('/js/views/camera.js')).place()")
    return box["x"] + place["x"] + u * place["scale"], box["y"] + place["y"] + v * place["scale"]


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    page.mouse.move(*end)
    page.mouse.up()


def opened(open_page: OpenPage, site: Site) -> Page:
    """The page once it shows the frame of the whole drive: until then, views change by themselves."""
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    pixels(page, "#bev")
    return page


@pytest.mark.parametrize(("view", "canvas"), [("camera", "#camera"), ("plan", "#bev")])
def test_points_take_every_colour_that_is_offered(open_page: OpenPage, site: Site, view: str, canvas: str):
    page = opened(open_page, site)
    choice = page.get_by_label(f"Colour {view} points by")
    choice.select_option("age")
    looks = [pixels(page, canvas)]
    for by in COLOURS:
        choice.select_option(by)
        assert repainted(page, canvas, looks[-1]), by
        looks.append(pixels(page, canvas))
    assert len(set(looks)) == len(looks), "each one looks different"
    page.reload()
    wait_for_frame(page, START)
    expect(choice).to_have_value(COLOURS[-1])


def test_the_tape_measures_metres_in_the_plan(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    before = pixels(page, "#bev")
    page.get_by_role("group", name="plan tools").get_by_role("button", name="Tape").click()
    drag(page, on_plan(page, 10.0, 3.0), on_plan(page, 40.0, -5.0))
    tape = of_store(page, "get('tape')")
    assert [tape["from"][axis] for axis in "xy"] == pytest.approx([10.0, 3.0], abs=0.2)
    assert [tape["to"][axis] for axis in "xy"] == pytest.approx([40.0, -5.0], abs=0.2)
    words = page.evaluate("async (tape) => (await import('/js/views/measuring_tape.js')).tapeWords(tape)", tape)
    assert float(words.split()[0]) == pytest.approx(31.05, abs=0.3)
    assert repainted(page, "#bev", before)
    page.get_by_role("group", name="plan tools").get_by_role("button", name="Tape").click()
    assert of_store(page, "get('tape')") is None
    assert repainted(page, "#bev", before, like=True), "the plan has not moved"


def test_the_tape_holds_on_to_lidar_points_in_the_image(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    points = of_store(
        page,
        """(() => {
          const { count, uv, xyz, kind, image } = get("frame"), found = [];
          for (let i = 0; i < count; i++) {
            const u = uv[2 * i], v = uv[2 * i + 1];
            const isInside = u > 0.3 * image.width && u < 0.7 * image.width && v > 30 && v < image.height - 60;
            if (kind[i] === 2 && isInside) {
              found.push({ u, v, x: xyz[3 * i] / 100, y: xyz[3 * i + 1] / 100, z: xyz[3 * i + 2] / 100 });
            }
          }
          found.sort((a, b) => a.u - b.u);
          return [found[0], found[found.length - 1]];
        })()""",
    )
    first, last = points
    page.keyboard.down("Shift")
    drag(page, in_image(page, first["u"], first["v"]), in_image(page, last["u"], last["v"]))
    page.keyboard.up("Shift")
    tape = of_store(page, "get('tape')")
    for end, point in (("from", first), ("to", last)):
        assert [tape[end][axis] for axis in "uv"] == pytest.approx([point["u"], point["v"]], abs=HOLD_PX)
        spot = json.dumps([tape[end][axis] for axis in "xyz"])
        is_there = f"{spot}.every((metres, k) => all[3 * i + k] === Math.round(100 * metres))"
        assert of_store(page, f"Array.from(get('frame').xyz).some((_, i, all) => {is_there})"), "it is a point's place"


def test_a_click_on_a_point_selects_its_object(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    point = of_store(
        page,
        """(() => {
          const { count, xyz, owner, result } = get("frame");
          for (let i = 0; i < count; i++) {
            const x = xyz[3 * i] / 100, y = xyz[3 * i + 1] / 100;
            const isNear = x > 5 && x < 70 && Math.abs(y) < 12;
            if (owner[i] > 0 && isNear) return { x, y, id: result.objects[owner[i] - 1].id };
          }
        })()""",
    )
    page.mouse.click(*on_plan(page, point["x"], point["y"]))
    assert of_store(page, "get('selection')") == point["id"]
    expect(page.locator("tr.is-selected td").first).to_have_text(f"#{point['id']}")


def test_what_lies_under_the_pointer_is_named(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    tick = site.engine.snapshot.processed
    assert tick is not None
    lead = tick.result.cipv
    assert lead is not None
    item = next(item for item in tick.result.objects if item.id == lead.id)
    assert item.bev is not None
    x, y = (sum(corner[axis] for corner in item.bev) / 4 for axis in (0, 1))
    page.mouse.move(*on_plan(page, x, y))
    expect(page.locator("#tooltip")).to_contain_text(f"#{lead.id}")
    expect(page.locator("#tooltip")).to_contain_text(f"{item.distance_m:.1f} m")
    page.mouse.move(*on_plan(page, 70.0, 12.5))
    expect(page.locator("#tooltip")).to_be_hidden()


def test_a_failed_test_of_the_selected_object_is_drawn_with_its_number(open_page: OpenPage, site: Site):
    """In the image at its box, in the plan as a distance from the centre of the path."""
    page = opened(open_page, site)
    tick = site.engine.snapshot.processed
    assert tick is not None
    aside = next(
        item
        for item in tick.result.objects
        if item.bev is not None
        and any(gate.name == "path_offset" and not gate.passed and gate.value is not None for gate in item.gates)
    )
    first = next(gate for gate in aside.gates if not gate.passed)
    found = f"get('frame').result.objects.find(({{ id }}) => id === {aside.id})"
    words = of_store(page, f"(await import('/js/views/drawing/gates.js')).failedWords({found})")
    assert first.name.replace("_", " ") in words
    page.evaluate("""() => {
      window.written = [];
      const write = CanvasRenderingContext2D.prototype.fillText;
      CanvasRenderingContext2D.prototype.fillText = function (words, ...rest) {
        window.written.push(`${this.canvas.id}: ${words}`);
        return write.call(this, words, ...rest);
      };
    }""")
    page.locator(f"#objects tr[data-id='{aside.id}']").click()
    settle(page)
    gate = next(gate for gate in aside.gates if gate.name == "path_offset")
    written = page.evaluate("window.written")
    assert f"bev: {gate.value:.2f} m, limit {gate.limit:.2f}" in written
    if aside.id in tick.result.layers.vision_boxes or aside.id in tick.result.layers.lidar_boxes:
        assert f"camera: {words}" in written


STROKES = """async () => {
  const { get } = await import("/js/core/store.js"), { drawObjects } = await import("/js/views/drawing/image.js");
  const frame = get("frame"), alphas = {};
  for (const item of frame.result.objects) {
    if (!frame.display.cuboids[item.id]) continue;
    const stroke = function () { alphas[item.id] = this.globalAlpha; };
    const ctx = { setLineDash() {}, beginPath() {}, moveTo() {}, lineTo() {}, stroke };
    const one = { ...frame, result: { ...frame.result, objects: [item] } }, axis = (pixel) => pixel;
    drawObjects(ctx, one, { cuboids: true }, { shows: () => false }, axis, axis);
  }
  return alphas;
}"""
"""How opaque the cuboid of each object in the image is drawn."""


def test_roadside_returns_are_fainter_in_the_image_than_vehicles(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    alphas = page.evaluate(STROKES)
    tick = site.engine.snapshot.processed
    assert tick is not None
    objects = {str(item.id): item for item in tick.result.objects}
    aside = [key for key in alphas if objects[key].source == "L" and not objects[key].in_path]
    vehicles = [key for key in alphas if "V" in objects[key].source and not objects[key].carried]
    assert aside
    assert vehicles
    assert max(alphas[key] for key in aside) < 0.5
    assert {alphas[key] for key in vehicles} == {1}


def test_the_windows_of_far_views_are_told_apart_and_switched_off_together(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    seen = [pixels(page, "#camera")]
    for window in ("far_view", "lanes_far_view"):
        windows = {"far_view": None, "lanes_far_view": None, window: [100, 60, 500, 300]}
        show_instead(page, frame={"display": windows})
        seen.append(pixels(page, "#camera"))
    assert len(set(seen)) == 3
    page.locator("[data-layer=farView]").click()
    assert repainted(page, "#camera", seen[0], like=True)


def test_trails_follow_what_is_played(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    for step in range(1, 4):
        page.keyboard.press("ArrowRight")
        wait_for_frame(page, START + step)
    lengths = page.evaluate(
        """async () => {
          const { get } = await import("/js/core/store.js"), { trailOf } = await import("/js/views/drawing/trails.js");
          return get("frame").result.objects.map(({ id }) => trailOf(id).length);
        }"""
    )
    assert max(lengths) == 4
    before = pixels(page, "#bev")
    page.locator("#bev-layers").get_by_role("button", name="Trails").click()
    assert repainted(page, "#bev", before)
    page.keyboard.press("Home")
    wait_for_frame(page, 0)
    assert page.evaluate("async () => (await import('/js/views/drawing/trails.js')).trailOf(1).length") <= 1, (
        "a jump ends them"
    )


def test_the_plan_shows_all_around_and_ahead_again(open_page: OpenPage, site: Site):
    page = opened(open_page, site)
    ahead = pixels(page, "#bev")
    tools = page.get_by_role("group", name="plan tools")
    tools.get_by_role("button", name="Around").click()
    assert repainted(page, "#bev", ahead)
    expect(tools.get_by_role("button", name="Around")).to_have_attribute("aria-pressed", "true")
    tools.get_by_role("button", name="Ahead").click()
    assert repainted(page, "#bev", ahead, like=True)


def test_no_wider_image_is_sent_than_is_shown(open_page: OpenPage, site: Site):
    """A wider one is sent as soon as the pane grows, even while paused."""
    page = opened(open_page, site)
    shown = box_of(page.locator("#camera"))["width"]
    sent = of_store(page, "get('frame').image.width")
    assert sent < shown + WIDTH_STEP_PX, "from the first one on"
    page.locator("[data-grow=camera]").click()
    wide = box_of(page.locator("#camera"))["width"]
    assert wide > shown + WIDTH_STEP_PX
    assert page.evaluate(
        """async (least) => {
          const { get, on } = await import("/js/core/store.js");
          if (get("frame").image.width >= least) return true;
          return new Promise((done) => on(["frame"], () => get("frame").image.width >= least && done(true)));
        }""",
        sent + WIDTH_STEP_PX,
    )


def test_a_message_that_cannot_be_read_does_not_end_the_stream(browser: Browser, site: Site):
    """The page logs it, so the console is not checked."""
    page = browser.new_page()
    try:
        page.add_init_script("""
          const Real = WebSocket;
          window.WebSocket = class extends Real {
            constructor(...about) {
              super(...about);
              window.stream = this;
            }
          };
          window.WebSocket.OPEN = Real.OPEN;
        """)
        page.goto(site.address)
        wait_for_frame(page, START)
        page.evaluate("() => stream.onmessage({ data: new ArrayBuffer(16) })")
        page.keyboard.press("ArrowRight")
        wait_for_frame(page, START + 1)
    finally:
        page.context.close()


CUT = """facts => {
  const box = facts.getBoundingClientRect(), words = facts.lastChild, range = document.createRange();
  return words.data.split(" ·").filter(fact => {
    const at = words.data.indexOf(fact);
    range.setStart(words, at);
    range.setEnd(words, at + fact.length);
    const { top, right } = range.getBoundingClientRect();
    return top < box.bottom - 2 && right > box.right + 1;
  });
}"""


@pytest.mark.parametrize("width", [1440, 1280, 1100])
def test_what_the_camera_pane_says_is_whole_or_absent(width: int, open_page: OpenPage, site: Site) -> None:
    page = open_page()
    page.set_viewport_size({"width": width, "height": 720})
    wait_for_frame(page, START)
    facts = page.locator("#camera-facts")
    expect(facts).to_contain_text("1280×720 ·")
    assert facts.evaluate(CUT) == []
