"""Labels made by hand: in the plan, in the picture, on the timeline, by one person and by two."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from pipeline.params import Params
from tests.browser.conftest import START, OpenPage, Pages, Site, opening
from tests.browser.judges import LOW_CONTRAST
from tests.browser.labeling import Hand, Labels, begin, is_at, is_saved
from tests.browser.looks import COUNT, box_of, go_to, on_timeline, pixels, repainted, wait_for_frame, whole_drive

SCREENS = Path(__file__).resolve().parents[2] / "build" / "screens"
EXPORT = "#label-pane .pane-bar > button"
LEAD_X, LEAD_Y = 34.6, 0.0
"""Where the simulated lead's middle is in the shown frame."""

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


REFUSED = ("status of 409", "status of 500", "status of 503", "ERR_FAILED")
"""What a browser's console says of requests that are refused."""


@dataclass
class Line:
    """Between a page and its server. Put there when the page opens: a busy browser may let a request through that comes
    right after. full: acts find no room on the server's disk. broken: the server fails at them. mute: they are done,
    and the answer is lost. deaf: the page does not hear what changed."""

    full: bool = False
    broken: bool = False
    mute: bool = False
    deaf: bool = False

    def act(self, route: Route) -> None:
        if self.full:
            route.fulfill(status=503, json={"detail": "the disk is full"})
        elif self.broken:
            route.fulfill(status=500, body="")
        elif self.mute:
            route.fetch()
            route.abort()
        else:
            route.continue_()

    def changes(self, route: Route) -> None:
        if self.deaf:
            route.abort()
        else:
            route.continue_()


@pytest.fixture(scope="module")
def desk(pages: Pages, site: Site) -> Iterator[tuple[Page, Line]]:
    """One page in the labeling mode, for all who label here."""
    line = Line()
    with opening(pages, site) as open_page:
        page = open_page(expects=REFUSED)
        page.route(re.compile(r"/api/labels/(act|undo)$"), line.act)
        page.route(re.compile(r"/api/labels\?since="), line.changes)
        begin(page)
        yield page, line


@pytest.fixture
def line(desk: tuple[Page, Line]) -> Line:
    return desk[1]


@pytest.fixture
def hand(desk: tuple[Page, Line], site: Site) -> Hand:
    """Nothing is labelled, nothing is selected, and the page is at ``START``."""
    page, line = desk
    line.full = line.broken = line.mute = line.deaf = False
    Labels(page, site.address).clear(COUNT)
    for _ in range(3):
        page.keyboard.press("Escape")
    page.get_by_role("tab", name="Tracks").click()
    page.get_by_role("button", name="Here", exact=True).click()
    is_at(page, START)
    expect(page.locator(".track-row")).to_have_count(0)
    return Hand(page)


@pytest.fixture
def labels(hand: Hand, site: Site) -> Labels:
    return Labels(hand.page, site.address)


def draw(hand: Hand, labels: Labels) -> int:
    """A cuboid on the simulated lead, drawn from its rear to its front; the new track's number."""
    before = set(labels.tracks)
    hand.keys("g")
    hand.drag(hand.plan(LEAD_X - 2.2, LEAD_Y), hand.plan(LEAD_X + 2.2, LEAD_Y))
    labels.wait_for(lambda now: len(now.tracks) == len(before) + 1)
    (made,) = set(labels.tracks) - before
    expect(hand.page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(made))
    return made


def test_a_cuboid_is_drawn_moved_turned_and_resized_in_the_plan(hand: Hand, labels: Labels):
    page = hand.page
    empty = pixels(page, "#camera")
    made = draw(hand, labels)
    drawn = labels.cuboid(made, START)
    assert drawn["center"][:2] == pytest.approx((LEAD_X, LEAD_Y), abs=0.2)
    assert drawn["size"][0] == pytest.approx(4.4, abs=0.3)
    assert repainted(page, "#camera", empty), "its edges are in the picture"

    hand.drag(hand.plan(LEAD_X, LEAD_Y), hand.plan(LEAD_X + 2, LEAD_Y + 1))
    labels.wait_for(lambda now: now.cuboid(made, START)["center"][0] > LEAD_X + 1)
    moved = labels.cuboid(made, START)
    assert moved["center"][:2] == pytest.approx((LEAD_X + 2, LEAD_Y + 1), abs=0.3)
    assert (moved["size"], moved["yaw_rad"]) == (drawn["size"], drawn["yaw_rad"])

    x, y = moved["center"][:2]
    hand.drag(hand.plan(x + moved["size"][0] / 2, y), hand.plan(x + moved["size"][0] / 2 + 1.5, y))
    labels.wait_for(lambda now: now.cuboid(made, START)["size"][0] > moved["size"][0] + 1)
    longer = labels.cuboid(made, START)
    rear = [each["center"][0] - each["size"][0] / 2 * math.cos(each["yaw_rad"]) for each in (moved, longer)]
    assert rear[1] == pytest.approx(rear[0], abs=0.02), "the opposite face stays"

    front = longer["center"][0] + longer["size"][0] / 2
    knob_u, knob_v = hand.plan(front, y)
    hand.drag((knob_u, knob_v - 16), hand.plan(longer["center"][0], y + 8))
    labels.wait_for(lambda now: abs(now.cuboid(made, START)["yaw_rad"]) > 1.3)
    assert labels.cuboid(made, START)["yaw_rad"] == pytest.approx(math.pi / 2, abs=0.1)
    is_saved(page)


def test_everything_is_done_by_keys_and_taken_back(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    start = labels.cuboid(made, START)
    for keys, dx, dy, deg in (
        (("ArrowUp", "ArrowUp", "ArrowLeft"), 0.2, 0.1, 0),
        (("Shift+ArrowDown", "Shift+ArrowRight"), -0.8, -0.9, 0),
        (("q", "Shift+Q", "e"), -0.8, -0.9, 10),
    ):
        hand.keys(*keys)
        labels.wait_for(
            lambda now, dx=dx, dy=dy, deg=deg: (
                now.cuboid(made, START)["center"][:2]
                == pytest.approx((start["center"][0] + dx, start["center"][1] + dy), abs=1e-6)
                and now.cuboid(made, START)["yaw_rad"] == pytest.approx(start["yaw_rad"] + math.radians(deg), abs=1e-6)
            )
        )
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")
    hand.keys("f", "f", "f")
    is_at(page, START + 3)
    hand.keys("k")
    labels.wait_for(lambda now: now.tracks[made]["keyframes"] == [START, START + 3])
    assert labels.tracks[made]["sightings"] == 4, "the frames between follow"
    expect(page.locator(".track-detail .facts").first).to_contain_text("keyframe")
    hand.keys("x")
    labels.wait_for(lambda now: len(now.tracks) == 2)
    hand.keys("r")
    labels.wait_for(lambda now: now.tracks[made]["state"] == "rejected")
    is_saved(page)

    page.reload()
    wait_for_frame(page, START + 3)
    begin(page)
    expect(page.locator(".track-row")).not_to_have_count(0)
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: now.tracks[made]["state"] != "rejected")
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: len(now.tracks) == 1)
    page.keyboard.press("Control+Shift+Z")
    labels.wait_for(lambda now: len(now.tracks) == 2)


def test_the_lead_is_painted_by_keys_by_number_and_by_a_drag(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    bare = pixels(page, "#timeline-back")
    hand.keys("i", *["f"] * 4)
    is_at(page, START + 4)
    hand.keys("c")
    labels.wait_for(lambda now: now.leads == [(START, START + 4, made)])
    assert repainted(page, "#timeline-back", bare)
    hand.keys("f")
    is_at(page, START + 5)
    hand.keys("u")
    labels.wait_for(lambda now: now.leads == [(START, START + 4, made), (START + 5, START + 5, "unknown")])
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_text("can't tell")
    hand.keys("0")
    labels.wait_for(lambda now: now.leads[-1] == (START + 5, START + 5, "none"))

    front = box_of(page.locator("#timeline-front"))
    y = front["y"] + 37
    hand.drag((front["x"] + on_timeline(page, 100), y), (front["x"] + on_timeline(page, 120), y), steps=8)
    labels.wait_for(lambda now: (100, 120, made) in now.leads)
    is_at(page, 120)
    hand.keys("Escape", "i")
    go_to(page, 130)
    is_at(page, 130)
    hand.keys(*str(made))
    labels.wait_for(lambda now: (100, 130, made) in now.leads or (121, 130, made) in now.leads)
    hand.keys("Shift+U")
    labels.wait_for(lambda now: now.leads[-1][1] == 129)


def test_a_hand_in_the_3d_view_moves_it_in_every_view(hand: Hand, labels: Labels):
    """What the server says of a drag there, as ``app/stream.py`` sends it."""
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    cuboid = labels.cuboid(made, START)
    cuboid["center"][0] -= 6.0
    dragged = """async ([track, frame, cuboid, ended]) => {
      const { set } = await import("/js/store.js");
      set("dragged", { track, frame, cuboid, ended });
    }"""
    plan, picture = pixels(page, "#bev"), pixels(page, "#camera")
    page.evaluate(dragged, [made, START, cuboid, False])
    assert repainted(page, "#bev", plan)
    assert repainted(page, "#camera", picture)
    assert labels.cuboid(made, START) != cuboid, "the hand still holds it"
    hand.keys("f")
    is_at(page, START + 1)
    page.evaluate(dragged, [made, START, cuboid, True])
    labels.wait_for(lambda now: now.cuboid(made, START) == cuboid)
    assert labels.cuboid(made, START + 1) is None, (
        "the frame in which it was taken hold of, not the one shown at the end"
    )


def test_what_the_picture_shows_is_lifted_and_boxed(hand: Hand, labels: Labels, site: Site):
    page = hand.page
    tick = site.engine.snapshot.tick
    assert tick is not None
    assert tick.frame.picture is not None
    height, width = tick.frame.picture.bgr.shape[:2]
    lead = next(each for each in tick.result.objects if each.id == tick.result.cipv.id)
    assert lead.bbox is not None
    u, v = (lead.bbox[0] + lead.bbox[2]) / 2, (lead.bbox[1] + lead.bbox[3]) / 2
    hand.keys("g")
    hand.press(hand.picture(u, v, width, height))
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (made,) = labels.tracks
    lifted = labels.cuboid(made, START)
    assert lifted["center"][:2] == pytest.approx((LEAD_X, LEAD_Y), abs=2.5), "where the car is"
    expect(page.locator(".said")).to_contain_text("points")

    box = labels.sighting(made, START)["bbox"] or list(lead.bbox)
    hand.keys("Shift+G")
    corners = (
        hand.picture(box[0] - 20, box[1] - 10, width, height),
        hand.picture(box[2] + 10, box[3] + 10, width, height),
    )
    hand.drag(*corners)
    wanted = [box[0] - 20, box[1] - 10, box[2] + 10, box[3] + 10]
    labels.wait_for(lambda now: now.sighting(made, START)["bbox"] == pytest.approx(wanted, abs=6))
    drawn = labels.sighting(made, START)["bbox"]
    hand.drag(
        hand.picture(drawn[0], (drawn[1] + drawn[3]) / 2, width, height),
        hand.picture(drawn[0] + 15, (drawn[1] + drawn[3]) / 2, width, height),
    )
    labels.wait_for(lambda now: now.sighting(made, START)["bbox"][0] == pytest.approx(drawn[0] + 15, abs=6))
    assert labels.sighting(made, START)["bbox"][1:] == pytest.approx(drawn[1:], abs=0.01), "one side moved"
    assert labels.cuboid(made, START)["center"] == lifted["center"], "a box is no cuboid"


def test_two_people_see_each_other_and_choose_when_they_disagree(
    hand: Hand, labels: Labels, line: Line, open_page: OpenPage, site: Site
):
    while hand.page.request.post(f"{site.address}/api/params/undo").ok:
        pass  # parameters changed by nobody in particular are everybody's to take back
    made = draw(hand, labels)
    is_saved(hand.page)
    other = open_page()
    wait_for_frame(other, START)
    second = begin(other, "Bob")
    row = other.locator(f".track-row[data-id='{made}']")
    expect(row).to_contain_text("car")
    row.click()
    undo = other.get_by_role("button", name="Undo your last change")
    expect(undo).to_be_disabled()  # what Ada did is hers to take back
    second.keys("t")
    expect(undo).to_be_enabled()
    expect(hand.page.locator(f".track-row[data-id='{made}']")).to_contain_text("truck")

    line.deaf = True  # the other's change does not reach this page before its own act
    labels.act("Bob", {"kind": "relabel", "track": made, "revision": labels.tracks[made]["revision"], "label": "bus"})
    hand.keys("Shift+T")
    dialog = hand.page.get_by_role("dialog", name="Two people changed the same label")
    expect(dialog).to_contain_text("Bob")
    expect(dialog).to_contain_text("bus")
    assert labels.tracks[made]["label"] == "bus", "nothing was written"
    line.deaf = False
    dialog.get_by_role("button", name="Keep mine").click()
    labels.wait_for(lambda now: now.tracks[made]["label"] == "car")
    is_saved(hand.page)
    assert [each["person"] for each in labels.get(f"/history?kind=track&id={made}")] == ["Ada", "Bob", "Bob", "Ada"]


def test_what_is_called_saved_is_what_the_server_answered(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    state = page.locator(".saved")
    before = labels.cuboid(made, START)
    line.full = True
    hand.keys("ArrowUp")
    expect(state).to_have_text("not saved: the disk is full")
    assert labels.cuboid(made, START) == before
    line.full = False
    page.get_by_role("button", name="Retry").click()
    labels.wait_for(lambda now: now.cuboid(made, START)["center"][0] == pytest.approx(before["center"][0] + 0.1))
    expect(state).to_contain_text("saved ")


def test_an_act_whose_answer_was_lost_is_done_once(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    line.mute = True
    hand.keys("t")
    expect(page.locator(".saved")).to_have_text("not saved: the server cannot be reached")
    done = labels.get(f"/history?kind=track&id={made}")
    line.mute = False
    page.get_by_role("button", name="Retry").click()
    is_saved(page)
    assert labels.get(f"/history?kind=track&id={made}") == done
    assert len(done) == 2


def test_what_the_server_fails_at_or_a_person_gives_up_holds_nothing_up(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    line.broken = True
    hand.keys("t")
    expect(page.locator(".said")).to_have_text("the server answered 500")
    line.broken, line.full = False, True
    hand.keys("t")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    line.full = False
    page.get_by_role("button", name="Discard").click()
    is_saved(page)
    assert labels.tracks[made]["label"] == "car"
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")


def test_what_follows_an_undo_that_waits_is_no_conflict_with_oneself(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    made = draw(hand, labels)
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "truck")
    is_saved(page)
    line.full = True
    hand.keys("Control+z")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    before = labels.cuboid(made, START)["center"][0]
    line.full = False
    hand.keys("ArrowUp")  # based on what the page knows: the undo has not been answered yet
    labels.wait_for(lambda now: now.cuboid(made, START)["center"][0] == pytest.approx(before + 0.1))
    assert labels.tracks[made]["label"] == "car"
    expect(page.get_by_role("dialog")).to_be_hidden()


def test_the_labels_of_another_database_are_read_anew(hand: Hand, labels: Labels):
    """As after a restart of the server: it knows less than the page does."""
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    page.evaluate(
        """async (made) => {
          const { get, set } = await import("/js/store.js"), labels = get("labels");
          const tracks = new Map(labels.tracks).set(99999, { ...labels.tracks.get(made), id: 99999 });
          set("labels", { ...labels, tracks, revision: labels.revision + 50 });
        }""",
        made,
    )
    page.get_by_role("button", name="All", exact=True).click()
    expect(page.locator(".track-row[data-id='99999']")).to_be_visible()
    page.evaluate("""async () => { (await import("/js/labeling/data.js")).look(); }""")
    expect(page.locator(".track-row[data-id='99999']")).to_have_count(0)
    expect(page.locator(f".track-row[data-id='{made}']")).to_be_visible()


def test_the_small_rules_of_sending(hand: Hand):
    """Where a page has no ``randomUUID``; two that ask for nothing in particular while one is under way; two items of
    one number."""
    page = hand.page
    made = page.evaluate(
        """async () => {
          const { newId } = await import("/js/labeling/acts.js"), own = newId();
          Object.defineProperty(crypto, "randomUUID", { value: undefined, configurable: true });
          const ids = [own, newId(), newId()];
          delete crypto.randomUUID;
          return ids;
        }"""
    )
    assert len(set(made)) == 3
    assert all(
        re.fullmatch(r"[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}", each) for each in made
    )
    sent = page.evaluate(
        """async () => {
          const { newestOnly } = await import("/js/api.js"), waits = [];
          let sent = 0;
          const submit = newestOnly(() => new Promise((done) => { sent += 1; waits.push(done); }));
          const first = submit(undefined);
          submit(undefined);
          submit(undefined);
          waits[0]();
          for (let turn = 0; turn < 100 && waits.length < 2; turn += 1) await null;
          waits[1]?.();
          await first;  // answered is what was submitted, and what waited with it
          return sent;
        }"""
    )
    assert sent == 2
    page.evaluate(
        """async () => {
          const { choose } = await import("/js/labeling/conflict.js");
          const items = [{ kind: "track", id: 3, revision: 5 }, { kind: "lead", id: 3, revision: 6 }];
          const item = { kind: "track", id: 3 }, theirs = { id: 3, revision: 9 };
          window.chosen = choose({ kind: "accept", items }, "Bob changed #3 since", item, theirs);
        }"""
    )
    page.get_by_role("button", name="Keep mine").click()
    assert [each["revision"] for each in page.evaluate("async () => (await window.chosen).items")] == [9, 6]


def test_proposals_are_accepted_exported_and_scored(hand: Hand, labels: Labels, site: Site):
    page = hand.page
    whole_drive(page, site)
    hand.keys("p")
    labels.wait_for(lambda now: len(now.leads) > 0)
    expect(page.locator(".track-row")).not_to_have_count(0)
    assert {each["state"] for each in labels.tracks.values()} == {"proposed"}
    expect(page.locator(".leads button[aria-pressed=true]")).to_have_count(1)
    hand.keys("Shift+A")
    labels.wait_for(lambda now: any(each["state"] == "accepted" for each in now.everything["leads"]))
    page.get_by_role("tab", name="Score").click()
    expect(page.locator(".label-score .metrics tbody tr")).not_to_have_count(0)
    page.get_by_role("tab", name="Tracks").click()
    page.get_by_role("button", name="To do").click()
    hand.keys("b")
    expect(page.locator(".said")).not_to_be_empty()
    with page.expect_download() as download:
        page.locator("#label-pane").get_by_role("button", name="Export").click()
        page.locator("#menu").get_by_text("CIPV Studio").click()
    written = json.loads(download.value.path().read_text(encoding="utf-8"))
    assert {each["id"] for each in written["labels"]["tracks"]} == set(labels.tracks)


@pytest.mark.parametrize(("width", "height", "theme"), [(1440, 900, "light"), (1024, 600, "dark")])
def test_it_is_legible_and_fits(open_page: OpenPage, site: Site, width: int, height: int, theme: str):
    page = open_page(width, height, color_scheme=theme)
    labels = Labels(page, site.address)
    labels.clear(COUNT)
    wait_for_frame(page, START)
    draw(begin(page), labels)
    pixels(page, "#timeline-back")
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / f"labeling_{width}_{theme}.png")
    assert page.evaluate(LOW_CONTRAST) == []
    assert nameless(page) == []
    for part in ("#label-bar", "#label-pane", "#label-keys", "#timeline-front", "#bev", "#camera", EXPORT):
        box = box_of(page.locator(part))
        assert box["x"] >= 0, part
        assert box["y"] >= 0, part
        assert box["x"] + box["width"] <= width, part
        assert box["y"] + box["height"] <= height, part


def nameless(page: Page) -> list[str]:
    """Controls of the mode that a screen reader has no name for."""
    return page.evaluate(
        """() => [...document.querySelectorAll("#label-bar button, #label-pane :is(button, select, input)")]
          .filter((node) => node.checkVisibility() && !(node.textContent.trim() || node.getAttribute("aria-label")))
          .map((node) => node.outerHTML)"""
    )


EDGES = [
    ("front", (13.0, 0.0), (10.5, 0.0), (5.0, 2.0)),
    ("rear", (7.0, 0.0), (9.5, 0.0), (5.0, 2.0)),
    ("left", (10.0, 2.0), (10.0, 0.5), (4.0, 3.0)),
    ("right", (10.0, 0.0), (10.0, 0.5), (4.0, 1.0)),
]
"""An edge, where it is dragged to, and the middle and the size that come of it."""


def test_the_opposite_face_is_held_whatever_the_heading(hand: Hand):
    """A cuboid of 4 m by 2 m at (10, 0), each edge dragged; and the same turned by any angle about its middle."""
    page = hand.page
    found = page.evaluate(
        """async (angles) => {
          const { dragged, footprint } = await import("/js/labeling/cuboid.js");
          const cuboid = (yaw_rad) => ({ center: [10, 0, 1], size: [4, 2, 2], yaw_rad });
          const held = { front: [2, 3], rear: [0, 1], left: [1, 2], right: [0, 3] };
          const away = [];
          for (const yaw of angles) for (const [grip, corners] of Object.entries(held)) {
            const before = cuboid(yaw), after = dragged(before, grip, { x: 0, y: 0 }, { x: 13.3, y: 2.7 });
            const [a, b] = [footprint(before), footprint(after)];
            away.push(Math.max(...corners.map((i) => Math.hypot(a[i][0] - b[i][0], a[i][1] - b[i][1]))));
            away.push(Math.max(0, 0.2 - Math.min(...after.size)));
          }
          return away;
        }""",
        [0.0, 0.4, 1.7, 3.0, -2.2],
    )
    assert max(found) < 1e-9
    sizes = page.evaluate(
        """async (edges) => {
          const { dragged } = await import("/js/labeling/cuboid.js");
          const cuboid = { center: [10, 0, 1], size: [4, 2, 2], yaw_rad: 0 };
          return edges.map(([grip, [x, y]]) => dragged(cuboid, grip, { x: 0, y: 0 }, { x, y }));
        }""",
        [[grip, to] for grip, to, _, _ in EDGES],
    )
    for (grip, to, center, size), got in zip(EDGES, sizes, strict=True):
        assert got["center"][:2] == pytest.approx(center), (grip, to)
        assert got["size"][:2] == pytest.approx(size), (grip, to)


def test_a_drive_is_reviewed_frozen_and_taken_back_in(hand: Hand, labels: Labels, tmp_path: Path):
    page = hand.page
    made = draw(hand, labels)
    hand.keys("h")
    dialog = page.get_by_role("dialog", name="Send back")
    dialog.get_by_label("Comment").fill("a metre too long")
    dialog.get_by_role("button", name="OK").click()
    expect(page.locator(".track-detail .comment")).to_have_text("Sent back: a metre too long")
    assert labels.tracks[made]["state"] == "proposed"
    hand.keys("a")
    labels.wait_for(lambda now: now.tracks[made]["state"] == "accepted")

    page.get_by_role("tab", name="Frame").click()
    page.get_by_role("button", name="Cut-in", exact=True).click()
    page.get_by_label("Tag of this frame").fill("rain")
    page.get_by_role("button", name="Add", exact=True).click()
    page.get_by_role("button", name="Draw the path").click()
    bare = pixels(page, "#bev")
    hand.drag(hand.plan(1, 0), hand.plan(30, 1), steps=6)
    labels.wait_for(lambda now: len(now.everything["paths"]) == 1)
    assert repainted(page, "#bev", bare)
    expect(page.locator(".moment-row")).to_have_count(2)
    held = labels.everything
    assert [(each["kind"], each["tracks"]) for each in held["events"]] == [("cut_in", [made])]
    assert [each["tag"] for each in held["tags"]] == ["rain"]
    (path,) = held["paths"]
    assert path["left"][0][1] - path["right"][0][1] == pytest.approx(2 * Params().path.half_width_m, abs=0.05)

    page.get_by_role("tab", name="Files").click()
    page.get_by_label("Name of the version").fill("reviewed")
    page.get_by_role("button", name="Freeze").click()
    version = page.locator(".label-files a", has_text="reviewed")
    expect(version).to_be_visible()
    page.get_by_label("Name of the version").fill("reviewed")
    page.get_by_role("button", name="Freeze").click()
    expect(page.locator("#label-files [role=alert]")).not_to_be_empty()
    expect(page.get_by_label("Name of the version")).to_have_value("reviewed")
    with page.expect_download() as download:
        version.click()
    download.value.save_as(tmp_path / "reviewed.json")
    page.get_by_role("tab", name="Tracks").click()
    hand.keys("Shift+Delete")
    labels.wait_for(lambda now: not now.tracks)
    page.get_by_role("tab", name="Files").click()
    page.get_by_label("File with labels").set_input_files(tmp_path / "reviewed.json")
    page.get_by_role("button", name="Import the file").click()
    labels.wait_for(lambda now: len(now.tracks) == 1)
    expect(page.locator(".said")).to_contain_text("1 track")
