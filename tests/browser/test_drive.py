"""The display in the car: what is old is covered, what matters is seen, a finger finds its buttons, and a day leaves no
trace in memory."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Browser, CDPSession, Page, WebSocketRoute, expect

from app.engine import Engine
from app.recording import RecordingDesk
from app.server import create_app
from app.tokens import Tokens
from pipeline.params import Params
from tests.app.recording import CountingDetector, Recording, opener
from tests.app.serving import serving
from tests.browser.conftest import START, WAIT_MS, OpenPage, Site
from tests.browser.judges import LOW_CONTRAST

WAIT_S = WAIT_MS / 1e3
SCREENS = Path(__file__).resolve().parents[2] / "build" / "screens"
SIZES = [(1024, 600), (1280, 800), (800, 480)]
FINGER_PX = 48
COVERED_WITHIN_MS = 300

OpenDisplay = Callable[..., Page]


@pytest.fixture
def open_display(browser: Browser) -> Iterator[OpenDisplay]:
    """Opens the display in a fresh profile, by touch; at the end no page may have complained or called elsewhere."""
    complaints: list[str] = []
    pages: list[Page] = []

    def begin(address: str, width: int = 1024, height: int = 600, *, quiet: bool = True, **context: Any) -> Page:
        page = browser.new_page(viewport={"width": width, "height": height}, has_touch=True, **context)
        pages.append(page)
        page.set_default_timeout(WAIT_MS)
        if quiet:
            page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
            page.on("pageerror", lambda error: complaints.append(str(error)))
        host = address.partition("//")[2].partition("/")[0]
        page.on("request", lambda r: complaints.append(r.url) if "://" in r.url and host not in r.url else None)
        page.goto(address if "/drive" in address else f"{address}/drive/")
        return page

    yield begin
    for page in pages:
        page.context.close()
    assert [text for text in complaints if not text.startswith(("blob:", "data:"))] == []


@pytest.fixture
def own(tmp_path: Path) -> Iterator[tuple[Site, Recording]]:
    """A dashboard of this test alone, which plays."""
    recording = Recording()
    engine = Engine(
        opener(recording),
        lambda _: CountingDetector(),
        Params(),
        uri=recording.uri,
        playing=True,
        desk=RecordingDesk(tmp_path),
    )
    engine.start()
    site = Site(engine, 0)
    site.start()
    yield site, recording
    recording.gate.set()
    site.stop()
    engine.stop()


def keep(page: Page, name: str) -> None:
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.screenshot(path=SCREENS / f"{name}.png")


def is_now(page: Page, kind: str) -> None:
    expect(page.locator("html")).to_have_attribute("data-freshness", kind)


# ------------------------------------------------------------ old is covered

WATCH = """async (within) => {
  const { get } = await import("/js/store.js");
  const { serverNow } = await import("/js/connection.js");
  const { mayBeMs } = await import("/drive/freshness.js");
  window.worst = { fresh: 0, covered: 0 };
  const cover = document.querySelector("#cover");
  const look = () => {
    const beyond = serverNow() - get("frame").madeUnixMs - mayBeMs(get("state"));
    const kind = cover.checkVisibility() && cover.dataset.kind !== "paused" ? "covered" : "fresh";
    window.worst[kind] = Math.max(window.worst[kind], beyond);
    document.body.dataset.wasLate = window.worst.covered > within;
  };
  setInterval(look, 5);
}"""
"""Milliseconds beyond its age at which a frame was still shown as fresh, by the page's own clock."""

ENDS = {"the line stands still": "stale", "the server is gone": "lost"}


@pytest.mark.parametrize("how", ENDS)
def test_what_is_too_old_is_covered_at_once_and_comes_back(
    open_display: OpenDisplay, own: tuple[Site, Recording], how: str
):
    site, recording = own
    page = open_display(site.address, quiet=ENDS[how] == "stale")
    is_now(page, "fresh")
    expect(page.locator("#distance")).not_to_have_text("–")
    page.evaluate(WATCH, COVERED_WITHIN_MS)
    if ENDS[how] == "stale":
        recording.gate.clear()
    else:
        site.stop()
    is_now(page, ENDS[how])
    expect(page.locator("#cover")).to_be_visible()
    for figure in ("#distance", "#closing", "#acc-word", "#ttc-value", "#road", "#plan", "#sensors"):
        expect(page.locator(figure)).to_be_hidden()
    expect(page.locator("body")).to_have_attribute("data-was-late", "true")
    assert page.evaluate("window.worst.fresh") <= COVERED_WITHIN_MS
    keep(page, f"drive_{ENDS[how]}")
    if ENDS[how] == "stale":
        recording.gate.set()
    else:
        page.locator("#mark").tap()
        expect(page.locator("#answer")).to_have_text("✕ Not marked: no connection")
        site.start()
    is_now(page, "fresh")
    expect(page.locator("#distance")).to_be_visible()


def test_a_paused_recording_is_not_old_but_says_so(open_display: OpenDisplay, own: tuple[Site, Recording]):
    site, _ = own
    page = open_display(site.address)
    is_now(page, "fresh")
    site.engine.control.change(playing=False)
    is_now(page, "paused")
    expect(page.locator("#cover")).to_contain_text("PAUSED")
    expect(page.locator("#distance")).to_be_visible()
    page.reload()
    is_now(page, "paused")
    site.engine.control.change(playing=True)
    is_now(page, "fresh")


def test_a_connection_that_says_nothing_any_more_is_left_for_another(browser: Browser, own: tuple[Site, Recording]):
    """As when a cable is pulled: the system takes the connection for open, and no end of it ever comes."""
    site, _ = own
    context = browser.new_context()
    page = context.new_page()
    opened: list[WebSocketRoute] = []

    def silent_at_first(route: WebSocketRoute) -> None:
        opened.append(route)
        if len(opened) > 1:
            route.connect_to_server()

    try:
        page.route_web_socket("**/api/stream**", silent_at_first)
        page.clock.install()
        page.goto(f"{site.address}/drive/")
        is_now(page, "waiting")
        for _ in range(5):
            page.clock.run_for(2000)  # one ping of the page each
        expect(page.locator("#distance")).not_to_have_text("–")
        assert len(opened) == 2
    finally:
        context.close()


# ------------------------------------------------------------ what is seen

STREAMS = """async () => {
  const { get, set } = await import("/js/store.js");
  const stream = (state, rate_hz) => ({ state, rate_hz, age_ms: 10, jitter_ms: 1, lost: 0, note: "" });
  const streams = { lidar: stream("ok", 10), camera: stream("stale", 5), gnss: stream("silent", null) };
  set("state", { ...get("state"), streams });
  return [...document.querySelectorAll("#sensors li")].map((one) =>
    [one.textContent, getComputedStyle(one).color, one.querySelector("path").getAttribute("d")]);
}"""
"""How sensors look in one that is well, one that is late and one that is silent."""


@pytest.mark.usefixtures("paused_in_traffic")
def test_a_sensor_that_fails_is_seen_by_colour_word_and_shape(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    expect(page.locator("#sensors li")).to_have_count(3)
    works, late, own_speed, gone = page.evaluate(STREAMS)
    assert [works[0], late[0], own_speed[0], gone[0]] == ["LiDAR10 Hz", "Camerastale", "Own speed", "GNSSsilent"]
    for column in (1, 2):
        assert len({works[column], late[column], gone[column]}) == 3


CUT_OFF = """() => {
  const { right } = document.querySelector(".lead").getBoundingClientRect();
  return [...document.querySelectorAll(".figure small")].filter((node) => node.getBoundingClientRect().right > right)
    .map((node) => node.textContent);
}"""
"""Units that large figures have pushed out of sight."""
SEEK = """() => fetch("/api/playback", {
  method: "POST", headers: { "content-type": "application/json" }, body: '{"seek": 1}',
}).then((answer) => answer.status)"""


@pytest.mark.usefixtures("paused_in_traffic")
def test_it_fits_a_finger_finds_it_and_it_can_be_read(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            is_now(page, "paused")
            expect(page.locator("#sensors li")).to_have_count(3)
            keep(page, f"drive_{width}x{height}_{scheme}")
            assert page.evaluate(LOW_CONTRAST) == []
        assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
            width,
            height,
        ]
        targets = page.eval_on_selector_all("button", "all => all.map((node) => node.getBoundingClientRect().toJSON())")
        assert len(targets) == 3
        for box in targets:
            assert min(box["width"], box["height"]) >= FINGER_PX
            assert box["right"] <= width
            assert box["bottom"] <= height
        for worst in ("0.0", "188", "88.8"):
            page.locator("#distance").evaluate("(node, words) => (node.textContent = words)", worst)
            assert page.evaluate(CUT_OFF) == []


@pytest.mark.usefixtures("paused_in_traffic")
def test_the_dashboards_help_leads_there(open_page: OpenPage, site: Site):
    page = open_page()
    page.keyboard.press("?")
    page.get_by_role("link", name="Display").click()
    expect(page).to_have_url(f"{site.address}/drive/")
    is_now(page, "paused")


@pytest.mark.usefixtures("paused_in_traffic")
def test_the_figures_are_those_of_the_result(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    result = httpx.get(f"{site.address}/api/result", timeout=WAIT_S).json()
    lead = result["cipv"]
    assert lead is not None
    digits = 1 if lead["distance_m"] < 20 else 0
    expect(page.locator("#distance")).to_have_text(f"{lead['distance_m']:.{digits}f}")
    expect(page.locator("#closing")).to_have_text(f"{abs(lead['closing_speed_mps'] * 3.6):.0f}")
    expect(page.locator("#own-speed")).to_have_text(f"{result['ego']['speed_mps'] * 3.6:.0f}")
    expect(page.locator("#acc")).to_have_attribute("data-state", result["acc"]["state"])


SHOW = """async (change) => {
  const { get, set } = await import("/js/store.js");
  const frame = get("frame"), result = { ...frame.result, acc: { ...frame.result.acc, ...change } };
  set("frame", { ...frame, result });
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""
"""The shown frame with another command."""

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
    page.evaluate(SHOW, {"state": "warn", "reason": f"#{other['id']} would be hit in 1.9 s"})
    assert page.evaluate(ALARM_PIXELS, "#plan") > 20
    expect(page.locator("#acc-reason")).to_contain_text(f"#{other['id']} would be hit")
    page.evaluate(SHOW, {"state": "warn", "reason": "#987654 would be hit in 1.9 s"})
    assert page.evaluate(ALARM_PIXELS, "#plan") == 0


@pytest.mark.usefixtures("paused_in_traffic")
def test_warning_and_braking_differ_in_colour_word_and_shape(open_display: OpenDisplay, site: Site):
    page = open_display(site.address)
    is_now(page, "paused")
    looks = set()
    for state in ("follow", "warn", "full_brake"):
        page.evaluate(SHOW, {"state": state, "reason": "for a test"})
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


# ------------------------------------------------------------ night


def brightness(page: Page) -> np.ndarray:
    picture = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    return picture


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


# ------------------------------------------------------------ buttons


@pytest.mark.usefixtures("paused_in_traffic")
def test_a_marked_moment_lands_on_the_timeline(open_display: OpenDisplay, open_page: OpenPage, site: Site):
    page = open_display(site.address)
    is_now(page, "paused")
    page.locator("#mark").tap()
    expect(page.locator("#answer")).to_have_text(f"✓ Marked, frame {START + 1}")
    keep(page, "drive_marked")
    dashboard = open_page()
    marked = dashboard.locator("#events-list").get_by_text("marked")
    expect(marked).to_have_count(1)
    events = httpx.get(f"{site.address}/api/drive/events", timeout=WAIT_S).json()["events"]
    (mark,) = [event for event in events if event["kind"] == "mark"]
    assert mark["index"] == START
    assert httpx.delete(f"{site.address}/api/marks/{mark['mark']}", timeout=WAIT_S).status_code == 200
    expect(marked).to_have_count(0)


def test_recording_is_begun_and_ended_in_sight(open_display: OpenDisplay, own: tuple[Site, Recording], tmp_path: Path):
    site, _ = own
    page = open_display(site.address)
    record = page.locator("#record")
    is_now(page, "fresh")
    record.tap()
    expect(page.locator("#answer")).to_have_text("✓ Recording")
    expect(record).to_have_attribute("aria-pressed", "true")
    expect(record).to_contain_text(re.compile(r"0:0[1-9]\.\d"))
    record.tap()
    expect(page.locator("#answer")).to_have_text("✓ Recording saved")
    expect(record).to_have_attribute("aria-pressed", "false")
    assert len(list(tmp_path.glob("*.mcap"))) == 1


def test_a_refusal_is_said(open_display: OpenDisplay, tmp_path: Path):
    engine = Engine(opener(), None, Params(), desk=RecordingDesk(tmp_path))
    engine.start()
    try:
        with serving(create_app(engine)) as address:
            page = open_display(address, quiet=False)
            is_now(page, "waiting")
            page.locator("#record").tap()
            expect(page.locator("#answer")).to_have_text("✕ Not recorded: nothing is open that could be recorded")
            page.locator("#mark").tap()
            expect(page.locator("#answer")).to_have_text("✕ Not marked: no recording is open")
    finally:
        engine.stop()


def test_a_display_comes_by_its_link_and_may_only_what_it_needs(open_display: OpenDisplay, own: tuple[Site, Recording]):
    site, _ = own
    tokens = Tokens("person-0123456789abcdef", "display-0123456789abcde")
    with serving(create_app(site.engine, tokens=tokens)) as address:
        page = open_display(f"{address}/drive/?token={tokens.display}", quiet=False)
        is_now(page, "fresh")
        assert page.url == f"{address}/drive/"
        assert page.evaluate("document.cookie") == ""
        page.locator("#mark").tap()
        expect(page.locator("#answer")).to_contain_text("✓ Marked")
        assert page.evaluate(SEEK) == 403


# ------------------------------------------------------------ all day

KEEP_SOCKET = """
const Real = WebSocket;
window.WebSocket = class extends Real {
  constructor(...given) {
    super(...given);
    window.socket = this;
    this.addEventListener("message", ({ data }) => { if (typeof data !== "string") window.newest = data; });
  }
};
"""
FEED = """async (count) => {
  const { on } = await import("/js/store.js");
  let came = () => {};
  if (!window.feeding) on(["frame"], () => window.feeding());
  for (let i = 0; i < count; i++) {
    const shown = new Promise((done) => (window.feeding = done));
    window.socket.onmessage({ data: window.newest.slice(0) });
    await shown;
    if (i % 5 === 0) await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  }
}"""
"""The newest message again and again, as the stream would bring it, painted every few times."""


def used_bytes(devtools: CDPSession) -> tuple[float, dict[str, int]]:
    devtools.send("HeapProfiler.collectGarbage")
    counters = devtools.send("Memory.getDOMCounters")
    return devtools.send("Runtime.getHeapUsage")["usedSize"], counters


def test_a_long_day_leaves_nothing_behind(open_display: OpenDisplay, browser: Browser, own: tuple[Site, Recording]):
    site, _ = own
    site.engine.wait_for(lambda s: s.tick is not None and s.tick.result.cipv is not None, WAIT_S)
    context = browser.new_context(viewport={"width": 800, "height": 480})
    context.add_init_script(KEEP_SOCKET)
    page = context.new_page()
    try:
        page.goto(f"{site.address}/drive/")
        is_now(page, "fresh")
        site.engine.control.change(playing=False)
        is_now(page, "paused")
        devtools = context.new_cdp_session(page)
        page.evaluate(FEED, 300)
        heap, counters = used_bytes(devtools)
        page.evaluate(FEED, 2000)
        later, counted = used_bytes(devtools)
    finally:
        context.close()
    assert later - heap < 500_000, "250 bytes a frame would be 100 MB in half a day"
    assert counted["nodes"] <= counters["nodes"] + 20
    assert counted["jsEventListeners"] <= counters["jsEventListeners"] + 5
