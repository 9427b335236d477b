"""Rows of the objects table stay where they are while the pointer is over it, whatever frame is shown."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START, OpenPage, Site
from tests.browser.looks import box_of, table, wait_for_frame

pytestmark = pytest.mark.usefixtures("paused_in_traffic")


def test_an_object_keeps_its_row_while_the_pointer_is_over_the_table(open_page: OpenPage, site: Site):
    page = open_page()
    wait_for_frame(page, START)
    table(page)
    rows = page.locator("#objects tbody tr")

    def order() -> list[str | None]:
        return [row.get_attribute("data-id") for row in rows.all()]

    page.locator("#objects th[data-key=distance] button").click()
    before = order()
    box = box_of(rows.nth(1))
    page.mouse.move(box["x"] + 30, box["y"] + box["height"] / 2)
    later = START + 60
    site.engine.control.change(target=later)
    wait_for_frame(page, later)
    table(page)
    assert order()[: len(before)] == before
    page.mouse.down()
    page.mouse.up()
    expect(page.locator("#objects tbody tr[aria-selected=true]")).to_have_attribute("data-id", before[1] or "")
    page.mouse.move(2, 2)
    expect(page.locator("#objects tbody tr.is-gone")).to_have_count(0)
    expect(page.locator(f"#objects tbody tr:first-child:not([data-id='{before[0]}'])")).to_be_visible()
