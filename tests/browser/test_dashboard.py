"""The dashboard as a person uses it."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.browser.conftest import START, WAIT_MS, OpenPage, Site, serving
from tests.browser.looks import colours, frame_name, go_to, pixels, repainted, table, wait_for_frame, whole_drive

WAIT_S = WAIT_MS / 1e3

WITH_A_LONG_NAME = """() => {
  const bar = document.querySelector("#transport");
  bar.querySelector(".name").textContent = "a_frame_of_a_drive_from_Munich_".repeat(9);
  return Math.max(...[...bar.children].map((part) => part.getBoundingClientRect().right));
}"""
"""Where the playback bar ends, in pixels."""

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_it_opens_and_shows_the_frame_everywhere(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    tick = site.engine.snapshot.processed
    assert tick is not None
    assert frame_name(page) == tick.result.frame
    assert page.locator("#objects tbody tr").count() == len(tick.result.objects)
    pixels(page, "#camera")
    assert colours(page, "#camera") > 1000, "an image"
    assert colours(page, "#bev") > 8, "a plan with points and objects"
    expect(page.locator("#link")).to_have_text("connected")


def surely_brakes(shown: Snapshot) -> bool:
    """Whether the lead in the shown frame surely brakes."""
    lead = shown.processed.result.cipv if shown.processed is not None else None
    if lead is None or lead.accel_mps2 is None or lead.accel_sigma_mps2 is None:
        return False
    return lead.accel_mps2 < -2.0 * lead.accel_sigma_mps2


def test_the_banner_says_what_the_result_says(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    site.engine.wait_for(surely_brakes, WAIT_S)  # once enough of the frames before are computed too
    tick = site.engine.snapshot.processed
    assert tick is not None
    cipv = tick.result.cipv
    assert cipv is not None, "there is a lead at this frame"
    expect(page.locator("[data-figure=distance] .value span")).to_have_text(f"{cipv.distance_m:.1f}")
    accel, sigma = cipv.accel_mps2, cipv.accel_sigma_mps2
    assert accel is not None
    assert sigma is not None
    said = f"{cipv.reason}; brakes by {-accel:.1f} ± {sigma:.1f} m/s²"
    expect(page.locator(".lead .reason")).to_have_text(said)
    expect(page.locator("tr.is-cipv td").first).to_have_text(f"#{cipv.id}")


def test_it_plays_and_pauses(open_page: OpenPage, site: Site):
    page = open_page()
    page.keyboard.press("Space")
    site.engine.wait_for(lambda s: s.playing and s.index > START + 2, WAIT_S)
    page.get_by_role("button", name="Pause").click()
    site.engine.wait_for(lambda s: not s.playing, WAIT_S)
    wait_for_frame(page, site.engine.snapshot.index)


def test_it_steps_and_seeks(open_page: OpenPage):
    page = open_page()
    wait_for_frame(page, START)
    page.keyboard.press("ArrowRight")
    wait_for_frame(page, START + 1)
    page.get_by_role("button", name="Step back").click()
    wait_for_frame(page, START)
    go_to(page, 90)
    wait_for_frame(page, 90)
    page.locator("h1").click()
    page.keyboard.press("Home")
    wait_for_frame(page, 0)


def test_a_slider_on_the_paused_frame_changes_image_and_table_without_the_network(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    runs, before, camera = site.network_runs, table(page), pixels(page, "#camera")
    page.locator("[data-param='cluster.tolerance_m'] input[type=range]").fill("0.2")
    expect(page.locator("[data-section=cluster] .count")).to_have_text("1 changed")
    site.engine.wait_for(lambda s: s.params.cluster.tolerance_m == 0.2 and s.processed.params is s.params, WAIT_S)
    expect(page.locator("#objects tbody")).not_to_have_text(before)
    assert repainted(page, "#camera", camera)
    assert site.engine.snapshot.index == START
    assert site.network_runs == runs
    page.get_by_role("button", name="Reset tolerance").click()
    expect(page.locator("#objects tbody")).to_have_text(before)
    expect(page.locator("[data-section=cluster] .count")).to_have_text("")


def test_h_res_moves_the_projected_points_and_chooses_its_model(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    runs, camera = site.network_runs, pixels(page, "#camera")
    slider = page.locator("[data-param='alignment.h_res_deg'] input[type=range]")
    slider.fill(str(float(slider.input_value()) * 1.3))
    site.engine.wait_for(lambda s: s.params.alignment.model == "angular" and s.processed.params is s.params, WAIT_S)
    expect(page.locator("[data-param='alignment.model'] button[aria-pressed=true]")).to_have_text("angular")
    assert repainted(page, "#camera", camera)
    assert site.network_runs == runs


def test_parameters_can_be_searched_and_a_preset_chosen(open_page: OpenPage, site: Site):
    page = open_page()
    page.get_by_label("Search parameters").fill("slope")
    expect(page.locator(".param:visible")).to_have_count(1)
    page.get_by_label("Search parameters").fill("")
    page.get_by_label("Preset").select_option("paper")
    assert site.engine.wait_for(lambda s: s.preset == "paper", WAIT_S).params.fusion.assignment == "greedy"


def test_a_selected_object_is_explained(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    tick = site.engine.snapshot.processed
    assert tick is not None
    rejection = tick.result.rejected[0]
    plan, camera = pixels(page, "#bev"), pixels(page, "#camera")
    page.locator(f"#objects tr[data-id='{rejection.id}']").click()
    expect(page.locator("#why")).to_contain_text(f"#{rejection.id}")
    expect(page.locator("#why")).to_contain_text(rejection.reason)
    gates = next(item.gates for item in tick.result.objects if item.id == rejection.id)
    expect(page.locator("#why .gate")).to_have_count(len(gates))
    assert repainted(page, "#bev", plan) or repainted(page, "#camera", camera), "it is marked in the views too"
    page.keyboard.press("Escape")
    expect(page.locator("tr.is-selected")).to_have_count(0)


def test_a_click_in_the_image_or_the_plan_selects(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    tick = site.engine.snapshot.processed
    assert tick is not None
    assert tick.frame.image is not None
    lead = tick.result.cipv
    assert lead is not None
    boxes = tick.result.layers.vision_boxes or tick.result.layers.lidar_boxes
    number, box = min(boxes.items(), key=lambda item: (item[1][2] - item[1][0]) * (item[1][3] - item[1][1]))
    canvas = page.locator("#camera").bounding_box()
    assert canvas is not None
    height, width = tick.frame.image.bgr.shape[:2]
    scale = min(canvas["width"] / width, canvas["height"] / height)
    left, top = (canvas["width"] - width * scale) / 2, (canvas["height"] - height * scale) / 2
    middle = {"x": left + scale * (box[0] + box[2]) / 2, "y": top + scale * (box[1] + box[3]) / 2}
    page.locator("#camera").click(position=middle)
    expect(page.locator("tr.is-selected td").first).to_have_text(f"#{number}")
    page.keyboard.press("Escape")
    plan = page.locator("#bev").bounding_box()
    assert plan is not None
    # the plan is fitted: from 5 m behind the bumper to 74 m ahead, at least 13 m to either side
    per_metre = min((plan["height"] - 36) / 79, plan["width"] / 26)
    item = next(item for item in tick.result.objects if item.id == lead.id)
    assert item.bev is not None
    x, y = (sum(corner[axis] for corner in item.bev) / 4 for axis in (0, 1))
    page.locator("#bev").click(
        position={"x": plan["width"] / 2 - y * per_metre, "y": plan["height"] - 36 - (x + 5) * per_metre}
    )
    expect(page.locator("tr.is-selected td").first).to_have_text(f"#{lead.id}")


def test_the_plan_zooms_and_fits(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)  # until then, the frame may come anew
    fitted = pixels(page, "#bev")
    page.locator("#bev").hover()
    page.mouse.wheel(0, -400)
    assert repainted(page, "#bev", fitted)
    page.locator("#bev").dblclick(position={"x": 5, "y": 5})
    assert repainted(page, "#bev", fitted, like=True)


SAID = "rows => rows.map((row) => [row.dataset.id, row.cells[0].textContent, row.cells[3].textContent])"


def test_every_row_of_the_table_follows_and_the_focus_stays_with_its_object(open_page: OpenPage, site: Site):
    page = open_page()
    rows = page.locator("#objects tbody tr")
    said: dict[int, list[list[str]]] = {}
    for index in (START, START + 1):
        site.engine.control.seek(index)
        wait_for_frame(page, index)
        table(page)
        tick = site.engine.snapshot.processed
        assert tick is not None
        objects = {str(item.id): item for item in tick.result.objects}
        said[index] = rows.evaluate_all(SAID)
        assert {number for number, *_ in said[index]} == set(objects)
        assert len(said[index]) == len(objects)
        for number, name, distance in said[index]:
            assert name == f"#{number}"
            distance_m = objects[number].distance_m
            assert distance.startswith("–" if distance_m is None else f"{distance_m:.1f}")
    before, now = ([number for number, *_ in said[index]] for index in (START, START + 1))
    held = next(number for number in reversed(now) if number in before)
    page.locator(f"#objects tr[data-id='{held}']").focus()
    site.engine.control.seek(START)
    wait_for_frame(page, START)
    table(page)
    assert page.evaluate("document.activeElement.dataset.id") == held
    assert rows.count() > 5
    assert page.locator("#objects tbody tr[tabindex='0']").count() == 1, "Tab leaves the table with one press"
    page.keyboard.press("ArrowUp")
    up = page.evaluate("document.activeElement.dataset.id")
    expect(page.locator("#objects tbody tr[aria-selected=true]")).to_have_attribute("data-id", up)
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    assert page.evaluate("document.activeElement.dataset.id") == up != held
    page.keyboard.press("Escape")
    whole_drive(page, site)
    for lists in ("#events-list .event", "#why .ranked"):
        expect(page.locator(lists)).not_to_have_count(0)
        assert page.locator(f"{lists}[tabindex='-1']").count() == page.locator(lists).count() - 1 > 0


def test_layers_can_be_switched_off_and_stay_off(open_page: OpenPage):
    page = open_page()
    wait_for_frame(page, START)
    shown = pixels(page, "#camera")
    page.locator("#camera-layers").get_by_role("button", name="Points").click()
    assert repainted(page, "#camera", shown)
    page.reload()
    page.wait_for_selector("#objects tbody tr")
    expect(page.locator("[data-layer=points]")).to_have_attribute("aria-pressed", "false")


def test_whoever_joins_late_sees_the_same(open_page: OpenPage):
    first = open_page()
    go_to(first, 75)
    wait_for_frame(first, 75)
    second = open_page()
    wait_for_frame(second, 75)
    expect(second.locator("#objects tbody")).to_have_text(table(first))


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1024, 768), (800, 480)])
def test_everything_fits_on_the_screen(open_page: OpenPage, width: int, height: int):
    page = open_page(width, height)
    assert page.evaluate("[document.body.scrollWidth, document.body.scrollHeight]") == [width, height]
    for selector in ("#banner", "#camera", "#bev", "#transport", "#params-button"):
        box = page.locator(selector).bounding_box()
        assert box is not None
        assert box["width"] > 0
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width + 0.5
        assert box["y"] + box["height"] <= height + 0.5
    assert page.evaluate(WITH_A_LONG_NAME) <= width


def test_a_pane_can_have_the_whole_workspace_and_give_it_back(open_page: OpenPage):
    page = open_page()
    small, workspace = page.locator("#bev").bounding_box(), page.locator("#workspace").bounding_box()
    page.keyboard.press("m")
    large = page.locator("#bev").bounding_box()
    assert small is not None
    assert large is not None
    assert workspace is not None
    assert large["width"] > 1.5 * small["width"]
    assert large["x"] < workspace["x"] + 20
    page.keyboard.press("m")
    assert page.locator("#bev").bounding_box() == small


def test_on_a_small_screen_the_objects_are_one_press_away(open_page: OpenPage):
    page = open_page(800, 480)
    expect(page.locator("#objects")).to_be_hidden()
    page.get_by_role("button", name="Objects", exact=True).click()
    expect(page.locator("#objects")).to_be_visible()


def test_every_control_has_a_name(open_page: OpenPage):
    page = open_page()
    page.evaluate("document.querySelectorAll('details').forEach((section) => (section.open = true))")
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, canvas:not([aria-hidden]), iframe")]
          .filter((e) => !(e.getAttribute("aria-label") || e.textContent.trim() || e.title || e.labels?.length))
          .map((e) => e.outerHTML)"""
    )
    assert nameless == []


def test_help_and_theme(open_page: OpenPage):
    page = open_page()
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_contain_text("play or pause")
    page.get_by_role("button", name="Close").click()
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.keyboard.press("d")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != dark


def test_what_the_server_refuses_is_said_each_time_and_can_be_dismissed(open_page: OpenPage, site: Site):
    page = open_page(expects=("422",))
    before = site.engine.snapshot.uri
    for _ in range(2):
        page.locator("#source-button").click()
        page.get_by_label("Recording URI").fill("sim:" + "far" * 2000)
        page.get_by_role("button", name="Open", exact=True).click()
        said = page.locator(".notice[data-level=error]")
        expect(said).to_contain_text("4096")
        said.get_by_role("button", name="Dismiss").click()
        expect(said).to_have_count(0)
    assert site.engine.snapshot.uri == before


def test_a_lost_connection_is_said_and_found_again(browser, site: Site):
    """Old data never looks fresh. The browser logs refused connections here, so the console is not checked."""
    recording = Recording()
    engine = Engine(opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri)
    with serving(engine) as own:
        page = browser.new_page()
        try:
            page.goto(own.address)
            expect(page.locator("#link")).to_have_text("connected", timeout=WAIT_S * 1000)
            own.stop()
            expect(page.locator("#notices")).to_contain_text("Connection lost", timeout=WAIT_S * 1000)
            expect(page.locator("#link")).to_have_text("connection lost")
            own.start()
            expect(page.locator("#link")).to_have_text("connected", timeout=WAIT_S * 1000)
            expect(page.locator("#notices")).not_to_contain_text("Connection lost")
        finally:
            page.context.close()
