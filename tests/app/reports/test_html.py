"""The report shows every number, loads nothing, and escapes all text."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.reports.html import html, in_words
from app.reports.svg_charts import chart_svg, ticks
from pipeline.evaluation.report_sections import Chart, Coloured, ReportSection, Series, Table

SECTION = ReportSection(
    "one",
    "A <b>title</b>",
    ("Text & more",),
    (Table("Table", ("name", "value"), (("a<b", 1.234), ("c", None), ("d", Coloured(7, "red"))), "what it means"),),
    (Chart("Chart", "time s", "gap m", (Series("LiDAR", (0.0, 1.0, 2.0), (50.0, 30.0, 5.0)),)),),
)


class Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_every_value_is_there_and_text_stays_text() -> None:
    page = html([SECTION], "Report")
    reader = Reader()
    reader.feed(page)
    for word in ("A <b>title</b>", "Text & more", "a<b", "1.23", "–", "7", "what it means", "LiDAR", "gap m"):
        assert word in reader.words
    assert "b" not in reader.tags
    assert 'class="red"' in page


def test_nothing_is_loaded_from_anywhere() -> None:
    page = html([SECTION], "Report")
    assert not re.search(r"https?://|src=|@import|url\(|<script|<link", page)


def test_a_chart_draws_each_point_inside_its_frame() -> None:
    drawn = chart_svg(SECTION.charts[0])
    points = re.search(r'polyline points="([^"]+)"', drawn)
    assert points is not None
    places = [tuple(map(float, pair.split(","))) for pair in points[1].split()]
    assert len(places) == 3
    assert all(0 <= x <= 560 and 0 <= y <= 300 for x, y in places)
    assert places[0][0] < places[1][0] < places[2][0]
    assert places[0][1] < places[1][1] < places[2][1], "a falling gap falls on the page"


def test_a_line_of_one_point_is_drawn_as_a_point() -> None:
    """Such as a Pareto front of one set. It is larger than the points of other series, which may lie below it."""
    one, all_ = Series("front", (2.0,), (1.0,)), Series.of_points("sets", [(2.0, 1.0), (3.0, 4.0)])
    drawn = chart_svg(Chart("Chart", "x", "y", (all_, one)))
    assert "polyline" not in drawn
    front = re.findall(r'<circle cx="([^"]+)" cy="([^"]+)" r="([^"]+)" class="fill1"/>', drawn)
    sets = re.findall(r'<circle cx="([^"]+)" cy="([^"]+)" r="([^"]+)" class="fill0"/>', drawn)
    assert front[0][:2] == sets[0][:2]
    assert float(front[0][2]) > float(sets[0][2])
    assert len(front) == 2, "one in the chart, one in the legend"


def test_an_empty_chart_says_so() -> None:
    assert "no data" in chart_svg(Chart("Empty", "x", "y", (Series("none", (), ()),)))


@given(st.floats(-1e4, 1e4), st.floats(0.0, 1e4))
def test_ticks_span_the_values(low: float, span: float) -> None:
    marks = ticks(low, low + span)
    assert marks[0] <= low + 1e-9 * max(1.0, abs(low))
    assert marks[-1] >= low + span - 1e-9 * max(1.0, abs(low) + span)
    assert 2 <= len(marks) <= 14


@pytest.mark.parametrize(("value", "text"), [(None, "–"), (1.005, "1.00"), (3, "3"), ("word", "word"), (-0.5, "-0.50")])
def test_values_as_people_read_them(value: str | float | int | None, text: str) -> None:
    assert in_words(value, 2) == text
