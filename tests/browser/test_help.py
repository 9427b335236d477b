"""The help pages in a browser: tables that are wider than the text can be read."""

from __future__ import annotations

import pytest

from tests.browser.conftest import OpenPage, Site

PAGES = ["accuracy", "accuracy-distances", "accuracy-ego-motion", "accuracy-alignment", "accuracy-traffic"]
MOST_SCROLLED = 2
"""Number of tables that are too wide even for a large screen."""
SCROLLED = """() => [...document.querySelectorAll(".wide")].map((wide) => {
  const cell = wide.querySelector("tbody td"), before = cell.getBoundingClientRect().left;
  wide.scrollLeft = 1e4;
  return { by: wide.scrollLeft, moved: cell.getBoundingClientRect().left - before };
})"""
"""How far each table of the page can be scrolled, and how far that moves the names of its rows."""


@pytest.mark.parametrize("width", [1440, 1024, 390])
def test_wide_tables_keep_the_names_of_their_rows_in_sight(open_page: OpenPage, site: Site, width: int) -> None:
    page = open_page()
    page.set_viewport_size({"width": width, "height": 800})
    tables = []
    for name in PAGES:
        page.goto(f"{site.address}/help/reference/{name}")
        assert page.evaluate("document.documentElement.scrollWidth") == width, name
        tables += page.evaluate(SCROLLED)
    assert len(tables) > len(PAGES)
    assert {table["moved"] for table in tables} == {0}
    if width == 390:
        assert any(table["by"] for table in tables), "else nothing was tested"
    if width == 1440:
        assert sum(table["by"] > 0 for table in tables) <= MOST_SCROLLED, "there is room beside the text"
