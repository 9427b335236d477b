"""A person in the labeling mode: hands that are counted, and what the server knows of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from playwright.sync_api import Page, expect

from tests.browser.looks import box_of, pauses

FROM_M, TO_M, HALF_M, TOOLS_PX = -5.0, 74.0, 13.0, 36
"""Initial extent of the plan (static/js/views/drawing/viewport.js)."""
KEYSTROKE_S = {"key": 0.28, "press": 0.20, "point": 1.10, "decide": 1.35}
"""Times in seconds of the keystroke-level model (Card, Moran and Newell 1980): key press, mouse click, pointing, and
mental preparation before an act. They estimate a person's time, which no test can measure."""
LEAD_X, LEAD_Y = 34.6, 0.0
"""Position of the simulated lead's centre in the shown frame."""
LEADS_Y = 50
"""Centre of the leads' row on the timeline, below one row of tags (static/js/timeline/rows.js)."""

Spot = tuple[float, float]


@dataclass
class Hand:
    """Counts keys, clicks and drags on a page."""

    page: Page
    counts: dict[str, int] = field(default_factory=lambda: {"keys": 0, "presses": 0, "drags": 0, "acts": 0})

    def keys(self, *names: str) -> None:
        """One act: one or more keys."""
        self.counts["acts"] += 1
        for name in names:
            self.counts["keys"] += 1
            self.page.keyboard.press(name)

    def press(self, spot: Spot) -> None:
        self.counts["acts"] += 1
        self.counts["presses"] += 1
        self.page.mouse.click(*spot)

    def drag(self, start: Spot, end: Spot, steps: int = 4) -> None:
        self.counts["acts"] += 1
        self.counts["drags"] += 1
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=steps)
        self.page.mouse.up()

    @property
    def modelled_s(self) -> float:
        """Time of these acts by the keystroke-level model."""
        of, n = KEYSTROKE_S, self.counts
        return (
            n["acts"] * of["decide"]
            + n["keys"] * of["key"]
            + n["presses"] * (of["point"] + of["press"])
            + n["drags"] * (2 * of["point"] + of["press"])
        )

    def plan(self, x: float, y: float) -> Spot:
        """Page pixel of a position in the plan."""
        box = box_of(self.page.locator("#bev"))
        scale = min((box["height"] - TOOLS_PX) / (TO_M - FROM_M), box["width"] / (2 * HALF_M))
        middle = FROM_M + (box["height"] / 2 - TOOLS_PX) / scale
        return box["x"] + box["width"] / 2 - y * scale, box["y"] + box["height"] / 2 - (x - middle) * scale

    def image(self, u: float, v: float, width: int, height: int) -> Spot:
        """Page pixel of a pixel of a camera image of that size."""
        box = box_of(self.page.locator("#camera"))
        scale = min(box["width"] / width, box["height"] / height)
        left, top = (box["width"] - width * scale) / 2, (box["height"] - height * scale) / 2
        return box["x"] + left + u * scale, box["y"] + top + v * scale


class Labels:
    """The labels on a server."""

    def __init__(self, page: Page, address: str) -> None:
        self._page, self._address = page, address

    def get(self, path: str) -> Any:
        # a kept connection may be closed by the server in the moment in which it is used again
        answer = self._page.request.get(f"{self._address}/api/labels{path}", max_retries=2)
        assert answer.ok, (path, answer.text())
        return answer.json()

    def act(self, person: str, act: dict[str, Any]) -> Any:
        body = {"person": person, "act": act, "drive": self.get("")["drive"]["id"]}
        answer = self._page.request.post(f"{self._address}/api/labels/act", data=body)
        assert answer.ok, (act, answer.text())
        return answer.json()

    def ask(self, path: str, body: dict[str, Any]) -> Any:
        """Response of a route other than those of labels."""
        answer = self._page.request.post(f"{self._address}/api/{path}", data=body)
        assert answer.ok, (path, answer.text())
        return answer.json()

    @property
    def everything(self) -> Any:
        return self.get("?since=0")

    @property
    def tracks(self) -> dict[int, Any]:
        return {track["id"]: track for track in self.everything["tracks"]}

    @property
    def leads(self) -> list[tuple[int, int, int | str]]:
        """(first, last, who), by frame."""
        return sorted((each["first"], each["last"], each["lead"]) for each in self.everything["leads"])

    @property
    def tags(self) -> list[tuple[int, int, str]]:
        """(first, last, word), by frame."""
        return sorted((each["first"], each["last"], each["tag"]) for each in self.everything["tags"])

    def sighting(self, track: int, frame: int) -> Any:
        """A track's sighting in a frame; None without one."""
        rows = self.get(f"/frames?first={frame}&last={frame}")["sightings"].get(str(frame), [])
        return next((row for row in rows if row["track"] == track), None)

    def cuboid(self, track: int, frame: int) -> Any:
        found = self.sighting(track, frame)
        return None if found is None else found["cuboid"]

    def wait_for(self, holds: Callable[[Labels], bool]) -> None:
        """Wait until the server has it, since the page's requests are asynchronous."""
        for pause_ms in pauses():
            self._page.evaluate("(ms) => new Promise((done) => setTimeout(done, ms))", pause_ms)
            if holds(self):
                return
        raise AssertionError(json.dumps(self.everything)[:2000])

    def clear(self, count: int) -> None:
        """Remove all labels."""
        held = self.everything
        self._remove([("track", each) for each in held["tracks"]])
        held = self.everything
        self._remove([(kind, each) for kind in ("event", "path", "tag") for each in held[f"{kind}s"]])
        if self.leads:
            self.act("Nobody", {"kind": "clear_lead", "first": 0, "last": count - 1})

    def _remove(self, items: Iterable[tuple[str, Any]]) -> None:
        refs = [{"kind": kind, "id": each["id"], "revision": each["revision"]} for kind, each in items]
        if refs:
            self.act("Nobody", {"kind": "remove", "items": refs})


def begin(page: Page, person: str = "Ada") -> Hand:
    """Enter labeling mode under a name."""
    page.evaluate(f"localStorage.setItem('cipv.person', JSON.stringify('{person}'))")
    expect(page.locator("#label-button")).to_be_enabled()
    page.keyboard.press("Shift+L")
    expect(page.locator("#label-pane")).to_be_visible()
    return Hand(page)


def is_at(page: Page, index: int) -> None:
    """Wait until the page has painted the frame, so the next act refers to it."""
    expect(page.locator("#label-bar")).to_have_attribute("data-frame", str(index))


def is_saved(page: Page) -> None:
    """Wait until every act has been answered."""
    expect(page.locator(".saved")).to_have_attribute("data-state", "saved")


def draw(hand: Hand, labels: Labels) -> int:
    """Draw a cuboid on the simulated lead, from its rear to its front; returns the new track's id."""
    before = set(labels.tracks)
    hand.keys("g")
    hand.drag(hand.plan(LEAD_X - 2.2, LEAD_Y), hand.plan(LEAD_X + 2.2, LEAD_Y))
    labels.wait_for(lambda now: len(now.tracks) == len(before) + 1)
    (made,) = set(labels.tracks) - before
    expect(hand.page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(made))
    return made
