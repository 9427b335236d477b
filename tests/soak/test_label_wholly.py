"""Two real drives labelled wholly through the browser: every vehicle ahead to 50 m that the LiDAR has points on, and
who leads. The hand on mouse and keys knows the truth, as a person knows it from the image, and is counted. What it took
and how good the labels became is written to ``build/label_wholly.json``."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.common.geometry import Cuboid
from pipeline.detection import detector_for
from pipeline.labels.agreement import bev_iou, pairs
from pipeline.labels.cuboids.points_of import clustered, inside
from pipeline.params import Params
from pipeline.sources import open_source
from tests.browser.conftest import Pages, Site, browser, opening, pages  # noqa: F401
from tests.browser.labels.hands import Hand, Labels, begin, is_at, is_saved
from tests.browser.looks import PLOT_LEFT_PX, PLOT_RIGHT_PX, box_of
from tests.soak.label_quality import DRIVES, FARTHEST_M, by_frame, is_near, truth_of, vehicles

pytestmark = pytest.mark.soak

BUILD = Path(__file__).resolve().parents[2] / "build"
FEWEST_POINTS = 5
"""Minimum number of points: with fewer, neither a person nor the pipeline could locate a vehicle."""
SAME_PLACE_M = 2.5
GOOD_ENOUGH = 0.7
"""A person corrects a track whose overlap with the truth is lower, in the frame in which it is seen best."""
BEST_SEEN_M = 15.0
HALF_M = 50.0
"""Extent of the plan in every direction when the whole surroundings are shown."""
CLIP = range(414, 426)
"""Astyx frames in which the car approaches a lead."""


@dataclass
class Person:
    """A person who labels a drive and knows the truth."""

    hand: Hand
    labels: Labels
    count: int
    truth: dict[int, dict[int, Cuboid]]
    """Cuboids of each vehicle by frame, up to 50 m and with points on it."""
    seen: dict[str, int] = field(default_factory=dict)
    """The acts, in words."""

    @property
    def page(self) -> Page:
        return self.hand.page

    def note(self, what: str) -> None:
        self.seen[what] = self.seen.get(what, 0) + 1

    def around(self, x: float, y: float) -> tuple[float, float]:
        """Page pixel of a position in the plan of the whole surroundings."""
        box = box_of(self.page.locator("#bev"))
        scale = min(box["height"], box["width"]) / (2 * HALF_M)
        return box["x"] + box["width"] / 2 - y * scale, box["y"] + box["height"] / 2 - x * scale

    def go_to(self, frame: int) -> None:
        front = box_of(self.page.locator("#timeline-front"))
        width = front["width"] - PLOT_LEFT_PX - PLOT_RIGHT_PX
        u = front["x"] + PLOT_LEFT_PX + width * (frame + 0.5) / self.count
        self.hand.press((u, front["y"] + front["height"] - 16))
        is_at(self.page, frame)

    def select(self, track: int) -> None:
        """By a click on its row, if it is not selected already."""
        row = self.page.locator(f".track-row[data-id='{track}']")
        if row.get_attribute("aria-selected") == "true":
            return
        row.click()
        self.hand.counts["acts"] += 1
        self.hand.counts["presses"] += 1
        expect(row).to_have_attribute("aria-selected", "true")

    def cuboids(self, state: tuple[str, ...]) -> dict[int, dict[int, Any]]:
        """Cuboids by frame of each track in one of these states."""
        wanted = {number for number, track in self.labels.tracks.items() if track["state"] in state}
        found: dict[int, dict[int, Any]] = {number: {} for number in wanted}
        rows = self.labels.get(f"/frames?first=0&last={self.count - 1}")["sightings"]
        for frame, there in rows.items():
            for each in there:
                if each["track"] in wanted and each["cuboid"] is not None:
                    cuboid = each["cuboid"]
                    one = Cuboid(tuple(cuboid["center"]), tuple(cuboid["size"]), cuboid["yaw_rad"])
                    found[each["track"]][int(frame)] = one
        return found

    def whose(self, cuboids: dict[int, Cuboid]) -> int | None:
        """The vehicle that a track matches in most of its frames."""
        votes: list[int | None] = []
        for frame, cuboid in cuboids.items():
            there = [
                (math.dist(c[frame].center[:2], cuboid.center[:2]), n) for n, c in self.truth.items() if frame in c
            ]
            if there:
                near_m, number = min(there)
                votes.append(number if near_m < SAME_PLACE_M else None)
        best = max(set(votes), key=votes.count) if votes else None
        return best if best is not None and 2 * votes.count(best) >= len(votes) else None

    def wait_changed(self, track: int, revision: int) -> None:
        self.labels.wait_for(lambda now: now.tracks[track]["revision"] != revision)
        is_saved(self.page)

    def key(self, track: int, *keys: str) -> None:
        revision = self.labels.tracks[track]["revision"]
        self.hand.keys(*keys)
        self.wait_changed(track, revision)

    def extend(self, track: int) -> None:
        """The selected track, as far as its points are found."""
        self.hand.keys("Shift+C")
        expect(self.page.locator(".said")).to_contain_text(f"#{track}")
        is_saved(self.page)
        self.note("extended")

    def draw(self, frame: int, true: Cuboid, track: int | None) -> int:
        """Draw a cuboid from its rear to its front: a new track, or the selected one again."""
        self.go_to(frame)
        c, s = math.cos(true.yaw_rad), math.sin(true.yaw_rad)
        half = true.size[0] / 2
        ends = [self.around(true.center[0] + k * half * c, true.center[1] + k * half * s) for k in (-1, 1)]
        before = set(self.labels.tracks)
        revision = self.labels.tracks[track]["revision"] if track is not None else -1
        self.hand.keys("Shift+G" if track is not None else "g")
        self.hand.drag(ends[0], ends[1])
        if track is None:
            self.labels.wait_for(lambda now: len(now.tracks) == len(before) + 1)
            (track,) = set(self.labels.tracks) - before
            expect(self.page.locator(".track-row[aria-selected=true]")).to_have_attribute("data-id", str(track))
            is_saved(self.page)
        else:
            self.wait_changed(track, revision)
        return track


def best_frame(true: dict[int, Cuboid], among: set[int]) -> int:
    """The frame in which a vehicle is seen best."""
    return min(among, key=lambda at: abs(math.hypot(*true[at].center[:2]) - BEST_SEEN_M))


def label_everything(person: Person) -> None:
    """Label the whole drive from the pipeline's proposals."""
    hand, labels, page = person.hand, person.labels, person.page
    hand.keys("p")
    labels.wait_for(lambda now: len(now.leads) > 0)
    is_saved(page)
    taken: dict[int, int] = {}
    extended: set[int] = set()
    proposed = person.cuboids(("proposed",))
    page.get_by_role("button", name="To do", exact=True).click()
    page.get_by_label("Minimum confidence of proposals").fill("0")
    person.hand.counts["presses"] += 2
    sure = {number: track["confidence"] or 0.0 for number, track in labels.tracks.items()}
    for track in sorted(proposed, key=lambda each: (-sure[each], each)):
        number = person.whose(proposed[track])
        if number is None:
            continue
        person.select(track)
        common = proposed[track].keys() & person.truth[number].keys()
        true = person.truth[number]
        back = sum(math.cos(true[at].yaw_rad - proposed[track][at].yaw_rad) < 0 for at in common)
        if 2 * back > len(common):
            person.key(track, "Shift+X")
            person.note("reversed")
        if np.median([bev_iou(true[at], proposed[track][at]) for at in common]) < GOOD_ENOUGH:
            person.draw(best_frame(true, set(common)), true[best_frame(true, set(common))], track)
            person.key(track, "w")
            person.note("corrected")
        if not set(true) <= proposed[track].keys() and number not in taken:
            person.extend(track)
            extended.add(track)
        if labels.tracks[track]["state"] == "proposed":
            person.key(track, "a")
            row = f".track-row[data-id='{track}']"
            expect(page.locator(f"{row}[aria-selected=true]")).to_have_count(0)  # the next one is selected
        person.note("accepted")
        taken.setdefault(number, track)
    slider = page.get_by_label("Minimum confidence of proposals")
    slider.fill("1")
    page.get_by_role("button", name="Reject hidden").click()
    hand.counts["presses"] += 2
    labels.wait_for(lambda now: all(each["state"] != "proposed" for each in now.tracks.values()))
    is_saved(page)
    page.get_by_role("button", name="All", exact=True).click()
    for number, true in person.truth.items():
        drawn = taken.get(number)
        if drawn is None:
            at = best_frame(true, set(true))
            drawn = person.draw(at, true[at], None)
            person.note("drawn")
        elif set(true) <= person.cuboids(("accepted", "corrected"))[drawn].keys() or drawn in extended:
            continue
        else:
            person.select(drawn)
        if len(true) > 1:
            person.extend(drawn)
    for lead in labels.everything["leads"]:
        if lead["state"] == "proposed":
            person.go_to(lead["first"])
            hand.keys("Escape", "a")
            labels.wait_for(
                lambda now, first=lead["first"]: all(
                    each["state"] != "proposed" for each in now.everything["leads"] if each["first"] == first
                )
            )
            person.note("leads")


def judged(person: Person) -> dict[str, Any]:
    """Figures of the labels compared with the truth."""
    mine = person.cuboids(("accepted", "corrected"))
    overlaps, turned, wanted = [], 0, 0
    for frame in range(person.count):
        there = [cuboids[frame] for cuboids in person.truth.values() if frame in cuboids]
        ours = [cuboids[frame] for cuboids in mine.values() if frame in cuboids]
        wanted += len(there)
        for a, b, iou in pairs(there, ours) if there and ours else ():
            overlaps.append(iou)
            turned += math.cos(there[a].yaw_rad - ours[b].yaw_rad) < 0
    hands = sum(person.hand.counts[name] for name in ("keys", "presses", "drags"))
    return {
        "frames": person.count,
        "vehicles": len(person.truth),
        "cuboids": wanted,
        "labelled": len(overlaps),
        "iou_median": round(float(np.median(overlaps)), 3),
        "iou_0.7": round(float(np.mean(np.array(overlaps) >= GOOD_ENOUGH)), 2),
        "reversed": turned,
        "hands": hands,
        "hands_per_frame": round(hands / person.count, 2),
        "done": person.seen,
    }


def seen_vehicles(name: str, site: Site) -> dict[int, dict[int, Cuboid]]:
    """The truth: each vehicle's cuboids ahead to 50 m with points on them."""
    source = open_source(site.engine.snapshot.uri)
    found: dict[int, dict[int, Cuboid]] = {}
    for frame, there in by_frame(vehicles(truth_of(name, source)), is_near).items():
        sweep = source.frame(frame).sweep
        if sweep is None:
            continue
        known = clustered(sweep.points)
        for track, cuboid in there:
            if int((inside(known.points, cuboid, 0.0) & ~known.ground.mask).sum()) >= FEWEST_POINTS:
                found.setdefault(track.id, {})[frame] = cuboid
    return found


@pytest.fixture(params=["astyx", "0009"])
def desk(request: pytest.FixtureRequest, data_dir: Path, tmp_path: Path) -> Iterator[tuple[str, Site]]:
    """A page with the drive computed, paused at its start."""
    scheme, path = DRIVES[request.param].split(":")
    folder = data_dir / path
    if request.param == "astyx":
        folder = tmp_path / "astyx"
        for part in (each for each in (data_dir / path).iterdir() if each.is_dir()):
            (folder / part.name).mkdir(parents=True)
            for file in (each for each in part.iterdir() if int(each.stem) in CLIP):
                (folder / part.name / file.name).symlink_to(file)
    uri = f"{scheme}:{folder}"
    recorder = SessionRecorder(tmp_path / "sessions")
    engine = Engine(open_source, detector_for, Params(), uri=uri, whole_drives=True, recorder=recorder)
    site = Site(engine, 0)
    site.start()  # first: building the routes silences warnings for a moment, which other threads must not interrupt
    engine.start()
    engine.wait_for(lambda s: s.drive.total > 0 and s.drive.done == s.drive.total, 1200)
    engine.control.change(playing=False, target=0)
    engine.wait_for(lambda s: s.index == 0 and not s.playing, 60)
    yield request.param, site
    site.stop()
    engine.stop()


def test_a_drive_is_labelled_wholly(desk: tuple[str, Site], pages: Pages) -> None:  # noqa: F811
    name, site = desk
    with opening(pages, site) as open_page:
        page = open_page(1440, 900, expects=("status of 409",))  # nothing found to extend
        labels = Labels(page, site.address)
        person = Person(begin(page), labels, labels.get("")["drive"]["count"], seen_vehicles(name, site))
        page.set_default_timeout(60_000)
        page.get_by_role("button", name="Around", exact=True).click()
        label_everything(person)
        found = judged(person)
        BUILD.mkdir(exist_ok=True)
        file = BUILD / "label_wholly.json"
        known = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
        file.write_text(json.dumps(known | {name: found}, indent=2) + "\n", encoding="utf-8")
        print(name, found)
        page.screenshot(path=BUILD / f"label_wholly_{name}.png")
    assert found["labelled"] > 0.7 * found["cuboids"], FARTHEST_M
    assert found["hands_per_frame"] < 6, "what it took before there was anything to extend"
