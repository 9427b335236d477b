"""Cuboids and boxes under a hand: in the plan, in the image, in 3D."""

from __future__ import annotations

import math
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START, Site
from tests.browser.labels.conftest import Line
from tests.browser.labels.hands import LEAD_X, LEAD_Y, Hand, Labels, draw, is_at, is_saved
from tests.browser.looks import pixels, repainted

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_a_cuboid_is_drawn_moved_turned_and_resized_in_the_plan(hand: Hand, labels: Labels):
    page = hand.page
    empty = pixels(page, "#camera")
    made = draw(hand, labels)
    drawn = labels.cuboid(made, START)
    assert drawn["center"][:2] == pytest.approx((LEAD_X, LEAD_Y), abs=0.2)
    assert drawn["size"][0] == pytest.approx(4.4, abs=0.3)
    assert repainted(page, "#camera", empty), "its edges are in the image"

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


def test_a_hand_in_the_3d_view_moves_it_in_every_view(hand: Hand, labels: Labels):
    """The server's message about a drag there, as sent by ``app/streaming/stream.py``."""
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    cuboid = labels.cuboid(made, START)
    cuboid["center"][0] -= 6.0
    dragged = """async ([track, frame, cuboid, ended]) => {
      const { set } = await import("/js/core/store.js");
      set("dragged", { track, frame, cuboid, ended });
    }"""
    plan, image = pixels(page, "#bev"), pixels(page, "#camera")
    page.evaluate(dragged, [made, START, cuboid, False])
    assert repainted(page, "#bev", plan)
    assert repainted(page, "#camera", image)
    assert labels.cuboid(made, START) != cuboid, "the hand still holds it"
    hand.keys("f")
    is_at(page, START + 1)
    page.evaluate(dragged, [made, START, cuboid, True])
    labels.wait_for(lambda now: now.cuboid(made, START) == cuboid)
    assert labels.cuboid(made, START + 1) is None, (
        "the frame in which it was taken hold of, not the one shown at the end"
    )


def test_numbers_are_typed_a_key_held_down_is_one_act_and_a_class_offers_its_size(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    drawn, before = labels.cuboid(made, START), labels.everything["revision"]
    for _ in range(5):
        page.keyboard.down("ArrowUp")
    page.keyboard.up("ArrowUp")
    labels.wait_for(lambda now: now.cuboid(made, START) != drawn)
    assert labels.cuboid(made, START)["center"][0] == pytest.approx(drawn["center"][0] + 0.5)
    assert labels.everything["revision"] == before + 1
    hand.keys("Shift+PageUp")
    labels.wait_for(lambda now: now.cuboid(made, START)["size"][2] == pytest.approx(drawn["size"][2] + 0.1))
    page.get_by_label("Length, metres").fill("6.25")
    page.keyboard.press("Enter")
    labels.wait_for(lambda now: now.cuboid(made, START)["size"][0] == 6.25)
    page.get_by_label("Heading, degrees to the left").fill("90")
    page.keyboard.press("Enter")
    labels.wait_for(lambda now: now.cuboid(made, START)["yaw_rad"] == pytest.approx(math.pi / 2))
    hand.keys("t")
    page.get_by_role("button", name="Size of a truck").click()
    labels.wait_for(lambda now: now.cuboid(made, START)["size"] == [8.0, 2.5, 3.2])
    expect(page.get_by_role("button", name="Size of a truck")).to_be_hidden()
    page.get_by_role("tab", name="Checks").click()
    expect(page.locator("#label-checks")).to_contain_text("No problems found")
    is_saved(page)


def test_a_box_follows_its_cuboid_until_it_is_set_and_again_when_freed(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    facts = page.locator(".track-detail .facts").first
    expect(facts).not_to_contain_text("box set by hand")
    hand.keys("Shift+G", "Enter")
    labels.wait_for(lambda now: now.sighting(made, START)["bbox"] is not None)
    assert labels.sighting(made, START)["box_set"]
    expect(facts).to_contain_text("box set by hand")
    hand.keys("Escape", "Shift+S")
    labels.wait_for(lambda now: not now.sighting(made, START)["box_set"])
    expect(facts).not_to_contain_text("box set by hand")


def test_what_the_image_shows_is_lifted_and_boxed(hand: Hand, labels: Labels, site: Site):
    page = hand.page
    tick = site.engine.snapshot.processed
    assert tick is not None
    assert tick.frame.image is not None
    height, width = tick.frame.image.bgr.shape[:2]
    lead = next(each for each in tick.result.objects if each.id == tick.result.cipv.id)
    assert lead.bbox is not None
    u, v = (lead.bbox[0] + lead.bbox[2]) / 2, (lead.bbox[1] + lead.bbox[3]) / 2
    hand.keys("g")
    hand.press(hand.image(u, v, width, height))
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (made,) = labels.tracks
    lifted = labels.cuboid(made, START)
    assert lifted["center"][:2] == pytest.approx((LEAD_X, LEAD_Y), abs=2.5), "where the car is"
    expect(page.locator(".said")).to_contain_text("points")
    expect(page.locator(".track-detail .how")).to_contain_text("fitted to the")
    assert labels.tracks[made]["state"] == "proposed", "until a person says that it is so"

    box = labels.sighting(made, START)["bbox"] or list(lead.bbox)
    hand.keys("Shift+G")
    corners = (
        hand.image(box[0] - 20, box[1] - 10, width, height),
        hand.image(box[2] + 10, box[3] + 10, width, height),
    )
    hand.drag(*corners)
    wanted = [box[0] - 20, box[1] - 10, box[2] + 10, box[3] + 10]
    labels.wait_for(lambda now: now.sighting(made, START)["bbox"] == pytest.approx(wanted, abs=6))
    drawn = labels.sighting(made, START)["bbox"]
    hand.drag(
        hand.image(drawn[0], (drawn[1] + drawn[3]) / 2, width, height),
        hand.image(drawn[0] + 15, (drawn[1] + drawn[3]) / 2, width, height),
    )
    labels.wait_for(lambda now: now.sighting(made, START)["bbox"][0] == pytest.approx(drawn[0] + 15, abs=6))
    assert labels.sighting(made, START)["bbox"][1:] == pytest.approx(drawn[1:], abs=0.01), "one side moved"
    assert labels.cuboid(made, START)["center"] == lifted["center"], "a box is no cuboid"


def foot_of(labels: Labels, cuboid: dict[str, Any]) -> tuple[float, float]:
    """Pixel of the centre of its bottom."""
    flat = {**cuboid, "size": [0.01, 0.01, cuboid["size"][2]]}
    corners = labels.ask("project", {"cuboids": [flat]})["pixels"][0][:4]
    return sum(u for u, _ in corners) / 4, sum(v for _, v in corners) / 4


def test_a_cuboid_is_dragged_over_the_road_in_the_image(hand: Hand, labels: Labels, site: Site):
    page, tick = hand.page, site.engine.snapshot.processed
    assert tick is not None
    assert tick.frame.image is not None
    height, width = tick.frame.image.bgr.shape[:2]
    made = draw(hand, labels)
    is_saved(page)
    before = labels.cuboid(made, START)
    u, v = foot_of(labels, before)
    page.wait_for_function(
        """async ([track, frame]) => {
          const { get } = await import("/js/core/store.js");
          return get("projected")?.frame === frame && get("projected").pixels.has(track);
        }""",
        arg=[made, START],
    )
    plan = pixels(page, "#bev")
    hand.drag(hand.image(u, v - 3, width, height), hand.image(u + 30, v + 5, width, height), steps=6)
    labels.wait_for(lambda now: now.cuboid(made, START) != before)
    assert repainted(page, "#bev", plan)
    after = labels.cuboid(made, START)
    assert foot_of(labels, after) == pytest.approx((u + 30, v + 8), abs=1.5), "its foot is under the hand"
    assert (after["size"], after["yaw_rad"]) == (before["size"], before["yaw_rad"])
    assert after["center"][0] < before["center"][0] - 1, "lower in the image is nearer"
    assert after["center"][1] < before["center"][1] - 0.5


def test_a_ray_meets_the_ground_where_it_is_seen_first(hand: Hand):
    """The road rises by 5 % beyond 20 m, seen from a height of 1.5 m: (angle down, height above ground, position)."""
    cases = [(0.1, 0.0, 15.0), (0.1, 0.5, 10.0), (0.05, 0.0, 25.0), (-0.01, 0.0, 62.5), (-0.2, 0.0, None)]
    found = hand.page.evaluate(
        """async (cases) => {
          const { groundAt, seenOn } = await import("/js/labeling/views/cuboid.js");
          const ground = { edges: [0, 20, 60], planes: [[0, 0, 1, 0], [-0.05, 0, 1, 1]] };
          return cases.map(([down, above]) => {
            const place = seenOn(ground, [0, 0, 1.5], [1, 0, -down], above);
            return place && [place[0], 1.5 - down * place[0] - above - groundAt(ground, { x: place[0], y: 0 })];
          });
        }""",
        cases,
    )
    for (down, above, x), got in zip(cases, found, strict=True):
        assert (got is None) == (x is None), (down, above, got)
        if x is not None:
            assert got == pytest.approx([x, 0.0]), (down, above)


def test_everything_is_drawn_and_merged_by_keys_alone(hand: Hand, labels: Labels):
    page = hand.page
    hand.keys("g", "Enter")
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (first,) = labels.tracks
    placed = labels.cuboid(first, START)
    assert (placed["size"], placed["center"][0] - placed["size"][0] / 2) == ([4.5, 1.8, 1.5], pytest.approx(20.0))
    expect(page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(first))
    hand.keys("Shift+ArrowUp")
    labels.wait_for(lambda now: now.cuboid(first, START)["center"][0] == pytest.approx(placed["center"][0] + 1))

    hand.keys("Shift+G", "Enter")
    labels.wait_for(lambda now: now.sighting(first, START)["bbox"] is not None)
    box = labels.sighting(first, START)["bbox"]
    hand.keys("ArrowRight", "Shift+ArrowDown")
    labels.wait_for(lambda now: now.sighting(first, START)["bbox"][3] > box[3])
    moved = labels.sighting(first, START)["bbox"]
    assert moved[0] - box[0] == pytest.approx(moved[2] - box[2]), "the arrow moves the whole box"
    assert moved[1] == pytest.approx(box[1]), "and with Shift its lower side alone"
    hand.keys("Escape", "g", "Enter")
    labels.wait_for(lambda now: len(now.tracks) == 2)
    second = max(labels.tracks)
    expect(page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(second))
    hand.keys("m")
    expect(page.locator(".said")).to_contain_text(f"#{second}")
    hand.keys(".", "Enter")
    labels.wait_for(lambda now: set(now.tracks) == {second})


def test_a_path_is_drawn_on_by_keys_before_it_is_saved_and_after(hand: Hand, labels: Labels, line: Line):
    page = hand.page
    line.full = True
    hand.keys("Shift+P", "Enter")
    expect(page.locator(".saved")).to_have_text("not saved: the disk is full")
    hand.keys("Shift+P", "ArrowLeft", "ArrowLeft")
    line.full = False
    page.get_by_role("button", name="Retry").click()
    labels.wait_for(lambda now: len(now.everything["paths"]) == 1)
    is_saved(page)
    ours = labels.everything["paths"][0]
    hand.keys("ArrowUp", "Enter")
    labels.wait_for(lambda now: now.everything["paths"][0]["left"] != ours["left"])
    bent = labels.everything["paths"][0]
    assert bent["left"][0] == pytest.approx(ours["left"][0], abs=0.05), "it begins where it began"
    assert bent["left"][len(ours["left"]) - 1][1] - ours["left"][-1][1] == pytest.approx(0.5, abs=0.05)
    assert len(bent["left"]) == len(ours["left"]) + 1
    is_saved(page)
    hand.keys("Shift+P", "ArrowUp", "Enter")
    labels.wait_for(lambda now: len(now.everything["paths"][0]["left"]) == len(ours["left"]) + 2)


def test_a_label_without_a_cuboid_says_why_and_how_to_give_it_one(hand: Hand, labels: Labels):
    box = [500.0, 300.0, 560.0, 350.0]
    labels.act("Ada", {"kind": "add_track", "label": "car", "frame": START, "cuboid": None, "bbox": box})
    hand.page.locator(".track-row").click()
    facts = hand.page.locator(".track-detail .facts").first
    expect(facts).to_contain_text("image box only")
    hand.keys("Shift+G")
    hand.drag(hand.plan(30, 3), hand.plan(34, 3))
    expect(facts).to_contain_text("m ahead")
    labels.wait_for(lambda now: all(now.cuboid(made, START) is not None for made in now.tracks))


EDGES = [
    ("front", (13.0, 0.0), (10.5, 0.0), (5.0, 2.0)),
    ("rear", (7.0, 0.0), (9.5, 0.0), (5.0, 2.0)),
    ("left", (10.0, 2.0), (10.0, 0.5), (4.0, 3.0)),
    ("right", (10.0, 0.0), (10.0, 0.5), (4.0, 1.0)),
]
"""An edge, where it is dragged to, and the resulting centre and size."""


def test_the_opposite_face_is_held_whatever_the_heading(hand: Hand):
    """A cuboid of 4 m × 2 m at (10, 0), each edge dragged; then the same at any heading."""
    page = hand.page
    found = page.evaluate(
        """async (angles) => {
          const { dragged, footprint } = await import("/js/labeling/views/cuboid.js");
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
          const { dragged } = await import("/js/labeling/views/cuboid.js");
          const cuboid = { center: [10, 0, 1], size: [4, 2, 2], yaw_rad: 0 };
          return edges.map(([grip, [x, y]]) => dragged(cuboid, grip, { x: 0, y: 0 }, { x, y }));
        }""",
        [[grip, to] for grip, to, _, _ in EDGES],
    )
    for (grip, to, center, size), got in zip(EDGES, sizes, strict=True):
        assert got["center"][:2] == pytest.approx(center), (grip, to)
        assert got["size"][:2] == pytest.approx(size), (grip, to)


def test_classes_and_attributes_are_chosen_from_the_projects_list(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    classes = page.locator(".detail-head select")
    expect(classes.locator("option")).to_contain_text(["car", "truck", "van (car)"])
    classes.select_option("van")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "van")
    hand.keys("t")
    labels.wait_for(lambda now: now.tracks[made]["label"] == "semitrailer truck")
    hand.keys("t", "t", "t")  # faster than the answers come
    labels.wait_for(lambda now: now.tracks[made]["label"] == "bus")

    motion, occlusion = page.get_by_label("motion", exact=True), page.get_by_label("occlusion", exact=True)
    motion.select_option("parked")
    labels.wait_for(
        lambda now: [(each["name"], each["value"]) for each in now.tracks[made]["attributes"]] == [("motion", "parked")]
    )
    occlusion.select_option("1")
    labels.wait_for(lambda now: now.sighting(made, START)["occlusion"] == 1)
    expect(motion).to_have_value("parked")
    expect(occlusion).to_have_value("1")
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: now.sighting(made, START)["occlusion"] is None)
    expect(occlusion).to_have_value("")


def test_a_track_is_carried_on_by_one_key_and_taken_back_by_one(hand: Hand, labels: Labels):
    page = hand.page
    cuboid = {"center": [18.47, -3.6, 1.4], "size": [12.0, 2.5, 3.8], "yaw_rad": 0.0}
    added = labels.act("Bob", {"kind": "add_track", "label": "truck", "frame": START, "cuboid": cuboid, "bbox": None})
    made = added["changed"]["tracks"][0]["id"]
    page.locator(f".track-row[data-id='{made}']").click()
    hand.keys("Shift+C")
    labels.wait_for(lambda now: now.tracks[made]["last"] - now.tracks[made]["first"] > 10)
    assert labels.tracks[made]["keyframes"] == [START], "nobody has placed the others"
    expect(page.locator(".said")).to_contain_text(f"extended #{made} by")
    page.keyboard.press("Control+z")
    labels.wait_for(lambda now: (now.tracks[made]["first"], now.tracks[made]["last"]) == (START, START))
