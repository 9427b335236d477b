"""How the page looks and is reached: every view's image, contrast, touch, keys, layouts."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from pipeline.params import Params
from tests.browser.conftest import START, WAIT_MS, OpenPage, Site
from tests.browser.judges import LOW_CONTRAST, SMALL_TARGETS
from tests.browser.looks import pixels, repainted, settle, wait_for_frame, whole_drive

WAIT_S = WAIT_MS / 1e3
SCREENS = Path(__file__).resolve().parents[2] / "build" / "screens"
"""Images of each view, saved as build output."""

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def keep(page: Page, name: str) -> None:
    SCREENS.mkdir(parents=True, exist_ok=True)
    pixels(page, "#timeline-back")
    page.screenshot(path=SCREENS / f"{name}.png")


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_words_stand_out_from_their_ground(open_page: OpenPage, site: Site, theme: str):
    page = open_page(color_scheme=theme)
    wait_for_frame(page, START)
    whole_drive(page, site)
    keep(page, f"dashboard_{theme}")
    assert page.evaluate(LOW_CONTRAST) == []
    page.get_by_role("tab", name="Runs").click()
    page.keyboard.press("?")
    keep(page, f"help_{theme}")
    assert page.evaluate(LOW_CONTRAST) == []


@pytest.mark.parametrize(("width", "height"), [(1024, 768), (820, 1180)])
def test_fingers_find_their_targets_on_a_tablet(open_page: OpenPage, site: Site, width: int, height: int):
    page = open_page(width, height, has_touch=True, is_mobile=True)
    wait_for_frame(page, START)
    whole_drive(page, site)
    keep(page, f"tablet_{width}")
    assert page.evaluate(SMALL_TARGETS) == []
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        width,
        height,
    ]
    page.get_by_role("button", name="Inspect").tap()
    expect(page.locator("#params")).to_be_visible()
    keep(page, f"tablet_{width}_inspect")
    assert page.evaluate(SMALL_TARGETS) == []
    page.get_by_role("button", name="Inspect").tap()
    page.locator("#timeline-front").tap(position={"x": 300, "y": 34})
    site.engine.wait_for(lambda s: s.index != START, WAIT_S)


def test_every_view_is_kept_as_an_image(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    page.keyboard.press("a")
    expect(page.locator("#align-bar")).to_be_visible()
    keep(page, "align")
    page.keyboard.press("a")
    page.locator("#export-button").click()
    keep(page, "export")
    page.keyboard.press("Escape")
    expect(page.locator("#menu")).to_be_hidden()
    site.engine.control.change_params({"path.half_width_m": 3.0})
    expect(page.locator("#timeline-facts")).to_contain_text("frames differ")
    whole_drive(page, site)
    page.get_by_role("tab", name="Runs").click()
    keep(page, "what_if")
    for key, name in (("Shift+1", "camera"), ("Shift+2", "plan"), ("Shift+4", "objects")):
        page.keyboard.press(key)
        keep(page, name)
        page.keyboard.press(key)
    assert (
        len({(SCREENS / f"{name}.png").read_bytes() for name in ("align", "what_if", "camera", "plan", "objects")}) == 5
    )


def test_views_have_numbers_and_are_remembered(open_page: OpenPage):
    page = open_page()
    panes = {
        "1": ".camera-pane",
        "2": ".bev-pane",
        "4": ".table-pane",
        "5": ".why-pane",
        "6": ".params",
        "7": ".timeline-pane",
    }
    for key, pane in panes.items():
        page.keyboard.press(key)
        expect(page.locator(pane)).to_be_hidden()
        if key in "12":
            page.keyboard.press(key)
            expect(page.locator(pane)).to_be_visible()
    page.reload()
    page.wait_for_selector("#transport .name:not(:empty)")
    expect(page.locator(".table-pane")).to_be_hidden()
    expect(page.locator(".camera-pane")).to_be_visible()
    page.locator("#layout-button").click()
    page.get_by_label("Layout name").fill("bare")
    page.get_by_role("button", name="Save").click()
    page.locator("#menu").get_by_role("button", name="Everything").click()
    expect(page.locator(".table-pane")).to_be_visible()
    page.locator("#layout-button").click()
    page.locator("#menu").get_by_role("button", name="bare", exact=True).click()
    expect(page.locator(".table-pane")).to_be_hidden()


def test_a_gutter_is_moved_by_hand_and_by_keys(open_page: OpenPage):
    page = open_page()
    plan, gutter = page.locator(".bev-pane"), page.locator("[data-gutter=plan]")
    before = plan.bounding_box()
    gutter.focus()
    page.keyboard.press("ArrowLeft")
    after = plan.bounding_box()
    assert before is not None
    assert after is not None
    assert after["width"] == pytest.approx(before["width"] + 24, abs=4)
    gutter.dblclick()
    assert plan.bounding_box() == before


def test_j_k_and_l_play_back_stop_and_on(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    page.keyboard.press("j")
    site.engine.wait_for(lambda s: s.index < START - 2, WAIT_S)
    page.keyboard.press("k")
    page.keyboard.press("l")
    site.engine.wait_for(lambda s: s.playing and s.speed == 1.0, WAIT_S)
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.keyboard.press("l")
    site.engine.wait_for(lambda s: s.playing and s.speed == 2.0, WAIT_S)
    page.keyboard.press("k")
    site.engine.wait_for(lambda s: not s.playing, WAIT_S)


def test_the_help_tells_every_key(open_page: OpenPage):
    page = open_page()
    page.keyboard.press("?")
    for mode, keys in (
        ("page", ("Space", "J", "K", "L", "1", "7", "E", "I", "O", "Ctrl Z", "Shift L", "?")),
        ("labeling", ("P", "A", "R", "C", "0", "G", "Shift G", "Del", "N", "Shift N")),
    ):
        told = page.locator(f"#help-dialog [data-mode={mode}] kbd").all_inner_texts()
        assert len(told) == len(set(told))
        for key in keys:
            assert key in told
    reach = """pairs => pairs.map(({ children: [key, words] }) =>
      key.getBoundingClientRect().right - words.getBoundingClientRect().left)"""
    assert max(page.locator("#help-dialog .pair:has(kbd)").evaluate_all(reach)) < 0, "no key lies over its words"


def test_times_and_values_are_said_as_people_read_them(open_page: OpenPage):
    told = open_page().evaluate(
        """async () => {
          const { clock } = await import("/js/core/format.js");
          const { CURVES, said } = await import("/js/timeline/curves.js");
          const of = (key) => CURVES.find((curve) => curve.key === key);
          return [clock(0), clock(59.94), clock(59.97), clock(3600), said(of("ttc_s"), 220.1), said(of("ttc_s"), 4.84),
            said(of("closing_speed_mps"), -1.5)];
        }"""
    )
    assert told == ["0:00.0", "0:59.9", "1:00.0", "60:00.0", "> 60 s", "4.8 s", "−5.4 km/h"]


def test_a_parameter_is_found_by_its_name_and_by_words(open_page: OpenPage):
    page = open_page()
    weight, nothing = page.locator("[data-param='cluster.z_weight']"), page.get_by_text("No matching parameters")
    for typed in ("cluster.z_weight", "z weight", "Z_Weight"):
        page.get_by_label("Search parameters").fill(typed)
        expect(weight).to_be_visible()
        expect(page.locator("[data-param='sync.wait_ms']")).to_be_hidden()
        expect(nothing).to_be_hidden()
    page.get_by_label("Search parameters").fill("there is no such thing")
    expect(weight).to_be_hidden()
    expect(nothing).to_be_visible()


def test_an_address_that_could_not_be_opened_is_there_to_be_mended(open_page: OpenPage):
    page = open_page()
    page.route("**/api/source", lambda route: route.fulfill(status=202, body="{}"))
    address = page.get_by_label("Recording URI")
    for typed, offered in (("sim:strait", "sim:straight"), ("sim:cut_in", "sim:strait")):
        page.keyboard.press("f")
        expect(address).to_have_value(offered)
        address.fill(typed)
        address.press("Enter")
        expect(address).to_be_hidden()


OPENED_BEFORE = """async () => {
  const { get, set } = await import("/js/core/store.js"), state = get("state");
  for (const uri of ["/drive", "video:d.mp4", state.uri]) set("state", { ...state, uri });
}"""
"""Two other recordings, of which the server lists one with the name of its kind, then this one again."""


BUSY_SERVER = """() => {
  const asked = window.fetch, list = new Promise((done) => (window.answer = done));
  window.fetch = (url, ...rest) =>
    String(url).endsWith("api/sources") ? list.then((found) => Response.json(found)) : asked(url, ...rest);
}"""
"""Answers which recordings can be opened only when it is told what to answer."""


def test_what_can_be_opened_is_listed_recordings_first_and_the_dialog_does_not_wait_for_the_list(open_page: OpenPage):
    page = open_page()
    page.evaluate(OPENED_BEFORE)
    page.evaluate(BUSY_SERVER)
    page.keyboard.press("f")
    expect(page.get_by_label("Recording URI")).to_be_focused()
    offers = [{"uri": "sim:straight", "title": "Simulation"}, {"uri": "kitti:/drive", "title": "drive"}]
    expect(page.locator("#source-dialog")).to_contain_text("Loading the list")
    page.evaluate("found => window.answer(found)", {"sources": offers, "open": None})
    expect(page.locator(".open-list code")).to_have_text(["video:d.mp4", "kitti:/drive", "sim:straight"])
    expect(page.locator(".open-list button[aria-current=true]")).to_have_text("Simulationsim:straight")


def test_a_key_right_after_a_dialog_is_the_pages(open_page: OpenPage):
    page = open_page()
    page.keyboard.press("f")
    address = page.get_by_label("Recording URI")
    expect(address).to_be_visible()
    address.evaluate(
        """field => {
          field.closest("dialog").close();
          field.dispatchEvent(new KeyboardEvent("keydown", { key: "f", code: "KeyF", bubbles: true }));
        }"""
    )
    expect(address).to_be_visible()


WITHOUT_WEBGL = """() => {
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : context.call(this, kind, ...rest);
  };
}"""


def test_without_webgl_the_views_that_need_it_say_so(open_page: OpenPage):
    page = open_page()
    page.evaluate(WITHOUT_WEBGL)
    for tab, body in (("3D", "#three-body"), ("rerun", "#rerun-body")):
        page.get_by_role("tab", name=tab).click()
        expect(page.locator(body)).to_contain_text("needs WebGL 2, which this browser lacks or has switched off")
        expect(page.locator(f"{body} iframe")).to_have_count(0)


def test_the_3d_view_keeps_the_keys_that_fly_and_leaves_the_page_the_others(open_page: OpenPage, site: Site):
    page = open_page()
    page.route("**/viser/**", lambda route: route.fulfill(body="<input>", content_type="text/html"))
    theme = "() => document.documentElement.dataset.theme ?? null"
    before = page.evaluate(theme)
    page.keyboard.press("3")
    view = page.frame_locator("iframe[title='3D view']")
    view.locator("body").click()
    page.keyboard.press("d")
    page.keyboard.press("?")
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Esc returns all keys to the page")
    assert page.evaluate(theme) == before, "D flies"
    dialog.get_by_role("button", name="Close").click()
    view.locator("input").click()
    page.keyboard.press("?")
    expect(view.locator("input")).to_have_value("?")
    view.locator("body").click(position={"x": 5, "y": 60})
    page.keyboard.press("Home")
    site.engine.wait_for(lambda s: s.index == 0, WAIT_S)
    wait_for_frame(page, 0)
    page.keyboard.press("Escape")
    page.keyboard.press("ArrowRight")
    site.engine.wait_for(lambda s: s.index == 1, WAIT_S)


def test_a_gate_leads_to_the_parameter_behind_its_limit(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    camera = pixels(page, "#camera")
    page.locator("#why .gate", has_text="Path offset").click()
    focused = page.locator("[data-param='path.half_width_m'] input[type=range]")
    expect(focused).to_be_focused()
    page.keyboard.press("ArrowRight")
    site.engine.wait_for(lambda s: s.params.path.half_width_m > Params().path.half_width_m, WAIT_S)
    assert repainted(page, "#camera", camera), "the corridor is wider in the image too"


def test_live_sensors_draw_what_came_and_let_go_of_the_oldest(open_page: OpenPage, site: Site):
    """The shown frame arrives repeatedly as if from live sensors, through the messages of the stream. All of it in one
    turn of the page, so that no message of the server comes between."""
    page = open_page()
    wait_for_frame(page, START)
    whole_drive(page, site)
    settle(page)
    counts, at, transport, is_repainted = page.evaluate(
        """async () => {
          const { get, set, drawNow } = await import("/js/core/store.js");
          const ribbon = document.querySelector("#timeline-back"), before = ribbon.toDataURL();
          const frame = get("frame"), counts = [];
          const columns = Object.entries(get("drive").now.columns);
          const row = Object.fromEntries(columns.map(([name, values]) => [name, values[0]]));
          for (let k = 0; k < 1300; k++) {
            const state = { ...frame.state, live: true, uri: "live:car.yaml", time_s: k / 10, count: 0, index: k };
            set("state", state);
            set("frame", { ...frame, state, row });
            counts.push(get("drive").count);
          }
          drawNow();
          const at = document.querySelector("#timeline-front").getAttribute("aria-valuenow");
          return [counts, at, document.querySelector("#transport").innerText, ribbon.toDataURL() !== before];
        }"""
    )
    assert counts[:3] == [1, 2, 3]
    assert counts[-1] == 1200, "a day of driving does not grow the page"
    assert at == "1199", "it stands at the newest"
    assert "LIVE" in transport
    assert is_repainted
