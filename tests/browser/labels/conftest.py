"""One page in the labeling mode, and what can go wrong between it and its server."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from playwright.sync_api import Page, Route, expect

from tests.browser.conftest import START, Pages, Site, opening
from tests.browser.labels.hands import Hand, Labels, begin, is_at
from tests.browser.looks import COUNT

REFUSED = ("status of 409", "status of 500", "status of 503", "ERR_FAILED")
"""What the browser's console logs for refused requests."""


@dataclass
class Line:
    """A faulty connection between a page and its server, installed when the page opens, since a busy browser may let
    through a request made right afterwards. full: the server's disk is full. broken: acts fail on the server. mute:
    acts are done but their responses are lost. deaf: the page receives no changes."""

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
    """One page in labeling mode, used by all tests in this folder."""
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
    """A page at ``START`` without labels and selection."""
    page, line = desk
    line.full = line.broken = line.mute = line.deaf = False
    Labels(page, site.address).clear(COUNT)
    for _ in range(3):
        page.keyboard.press("Escape")
    page.get_by_role("tab", name="Tracks").click()
    page.get_by_role("button", name="Here", exact=True).click()
    page.evaluate("async (index) => (await import('/js/drive/seek.js')).seekTo(index)", START)
    is_at(page, START)
    expect(page.locator(".track-row")).to_have_count(0)
    return Hand(page)


@pytest.fixture
def labels(hand: Hand, site: Site) -> Labels:
    return Labels(hand.page, site.address)
