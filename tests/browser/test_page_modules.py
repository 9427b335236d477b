"""Modules of the page by themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import OpenPage, Pages, Site, opening

ROWS = """async () => {
  const { metricsTable } = await import("/js/panels/metrics_table.js");
  const metrics = [[0.0701, 0.0699], [0.07, 0.05], [39, 38]].map(([base, run]) =>
    ({ name: "error", unit: "m", base, run, better: "lower" }));
  const table = metricsTable({ metrics, truth: "labels", judged: 39 });
  return [...table.querySelectorAll("tbody tr")].map((row) => [row.lastChild.textContent, row.dataset.change]);
}"""

TAGS = """async ([cars, ids]) => {
  const { drawTags } = await import("/js/views/drawing/plan_tags.js");
  const { Labels } = await import("/js/views/drawing/text_labels.js");
  const ctx = document.createElement("canvas").getContext("2d"), words = [];
  ctx.fillText = (text) => words.push(text);
  const labels = new Labels(ctx, 400, 0, 600);
  const items = cars.map(([id, x, y, in_path]) => ({ id, in_path, carried: false, source: "V", distance_m: x,
    bev: [[x, y - 1], [x, y + 1], [x + 4, y + 1], [x + 4, y - 1]] }));
  drawTags({ u: (y) => 200 - 10 * y, v: (x) => 600 - 10 * x }, items, ids, labels);
  return words.map((text, i) => ({ words: text, onACar: labels.kept.some((car) => over(labels.taken[i], car)),
    onATag: labels.taken.slice(0, i).some((tag) => over(labels.taken[i], tag)) }));
  function over(a, b) { return a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h; }
}"""
"""Tags in a plan of 10 pixels a metre. cars: id, x and y in metres, whether it is in the path."""
STREET = [(number, 4.5 * number, y, False) for number in range(1, 10) for y in (-8.0, -4.0, 4.0, 8.0)]
"""Cars parked in four rows, closer than their tags are high."""

SHAPES = """async () => {
  const { weights, styleOf } = await import("/js/timeline/lanes/flags.js");
  return weights().map((weight) => [weight.words, ...Object.values(styleOf(weight))]);
}"""

WHEEL = """async (wheel) => {
  const { Span } = await import("/js/timeline/span.js"), { followPointer } = await import("/js/timeline/pointer.js");
  const span = new Span(), canvas = document.createElement("canvas");
  Object.assign(span, { left: 0, width: 1000 });
  span.setCount(1000);
  span.zoom(0.1, 500);
  const before = [span.first, span.end];
  followPointer(canvas, { span, rows: () => ({ lanes: [] }), zoomed: () => {}, hovered: () => {} });
  canvas.dispatchEvent(new WheelEvent("wheel", { shiftKey: true, cancelable: true, ...wheel }));
  return [span.first - before[0], span.end - before[1]];
}"""


FIELD = """async () => {
  const { numberField, numberOf } = await import("/js/core/number_field.js");
  const field = numberField({ label: "Width of the test", least: 0, most: 8, step: 0.1 }, { value: "7" });
  window.heard = [];
  field.addEventListener("change", () => window.heard.push(numberOf(field)));
  document.querySelector("#params [aria-label='Width of the test']")?.remove();
  document.querySelector("#params").prepend(field);
}"""


@pytest.fixture(scope="module")
def around(pages: Pages, site: Site) -> Iterator[Page]:
    """A page from which modules are imported, whose state no test here depends on or changes."""
    with opening(pages, site) as open_page:
        yield open_page()


def tags(page: Page, cars: list[tuple[int, float, float, bool]], **ids: int) -> list[dict[str, Any]]:
    return page.evaluate(TAGS, [cars, {"lead": None, "chosen": None, "next": None, **ids}])


def test_a_change_that_rounds_to_nothing_is_no_improvement(around: Page) -> None:
    assert around.evaluate(ROWS) == [["=", "same"], ["−0.02", "better"], ["−1", "better"]]


def test_in_a_dense_street_no_tag_of_the_plan_covers_a_car_or_another_tag(around: Page) -> None:
    cars = [(100 + i, x, y, False) for i, (_, x, y, _) in enumerate(STREET)]
    drawn = tags(around, cars)
    assert 4 <= len(drawn) < len(cars)
    assert not [tag["words"] for tag in drawn if tag["onACar"] or tag["onATag"]]


def test_the_lead_the_selected_the_next_and_those_in_the_path_have_a_tag_where_there_is_no_room(
    around: Page,
) -> None:
    cars = [(100 + i, x, y, False) for i, (_, x, y, _) in enumerate(STREET)]
    chosen, lead, following, ahead = 120, 1, 2, 3
    cars += [(ahead, 30.0, 0.0, True), (following, 20.0, 0.0, True), (lead, 10.0, 0.0, True)]
    drawn = tags(around, cars, lead=lead, chosen=chosen, next=following)
    first = [re.search(r"#\d+", tag["words"]) for tag in drawn[:4]]
    assert [found and found[0] for found in first] == ["#1", "#120", "#2", "#3"]
    assert not [tag["words"] for tag in drawn if tag["onATag"]]


def test_events_of_different_weight_differ_in_shape_as_well_as_in_colour(around: Page) -> None:
    found = around.evaluate(SHAPES)
    assert [words for words, *_ in found] == ["information", "notice", "warning", "alarm", "mark"]
    assert len({color for _, color, _ in found}) == len({shape for *_, shape in found}) == len(found)


@pytest.mark.parametrize("axis", ["deltaY", "deltaX"])
def test_shift_and_the_wheel_pan_the_timeline_also_in_browsers_that_turn_the_wheel(around: Page, axis: str) -> None:
    first, end = around.evaluate(WHEEL, {axis: 50})
    assert first == pytest.approx(end) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("typed", "heard"),
    [("1,5", 1.5), ("1.5", 1.5), ("−1,5", -1.5), (" 15 ", 15), ("", None), ("1,234.5", "nothing"), ("x", "nothing")],
)
def test_a_number_may_be_typed_with_a_comma_and_what_is_none_is_taken_back(
    around: Page, typed: str, heard: Any
) -> None:
    around.evaluate(FIELD)
    field = around.get_by_label("Width of the test")
    field.press("Control+a")
    field.press_sequentially(typed) if typed else field.press("Delete")
    expect(field).to_have_attribute("aria-invalid", str(heard == "nothing").lower())
    field.press("Enter")
    assert around.evaluate("window.heard") == ([] if heard == "nothing" else [heard])
    expect(field).to_have_value("7" if heard == "nothing" else f"{heard:g}" if heard is not None else "")


def test_arrow_keys_step_a_number_within_its_limits(around: Page) -> None:
    around.evaluate(FIELD)
    field = around.get_by_label("Width of the test")
    for key in ("ArrowUp", "ArrowUp", "ArrowDown"):
        field.press(key)
    assert around.evaluate("window.heard") == [7.1, 7.2, 7.1]
    field.fill("7,95")
    field.press("ArrowUp")
    expect(field).to_have_value("8")


PRESS = """([key, code, modifiers]) => document.body.dispatchEvent(
  new KeyboardEvent("keydown", { key, code, ...modifiers, bubbles: true, cancelable: true }))"""


def test_the_row_of_digits_gives_digits_in_a_layout_that_types_them_with_shift(open_page: OpenPage) -> None:
    page = open_page()
    table, camera, speed = page.locator(".table-pane"), page.locator(".camera-pane"), page.locator("#transport select")
    page.evaluate(PRESS, ["'", "Digit4", {}])
    expect(table).to_be_hidden()
    page.evaluate(PRESS, ["'", "Digit4", {}])
    expect(table).to_be_visible()
    page.evaluate(PRESS, ["1", "Digit1", {"shiftKey": True}])
    expect(camera).to_contain_class("is-grown")
    expect(speed).to_have_value("1")
    page.evaluate(PRESS, ["]", "Digit9", {"modifierAltGraph": True}])  # as on a German keyboard
    expect(speed).not_to_have_value("1")
