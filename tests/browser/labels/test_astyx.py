"""A whole real drive labelled through the browser: from proposals to what is accepted, exported and scored, and the
same drive from nothing. What it took is kept in ``build/labeling.json``."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.drive.open_recording import RULE
from app.drive.run_results import results_of
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.common.geometry import Cuboid, closest_on_polygon
from pipeline.detection import detector_for
from pipeline.evaluation.scores.drive import Rules, score_drive
from pipeline.evaluation.scores.figures import FIGURES
from pipeline.evaluation.scores.truth import of_labels
from pipeline.fusion.vehicle_sizes import largest_size_m
from pipeline.labels.formats.native import from_json
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types.source import TruthObject
from tests.browser.conftest import OpenPage, Site
from tests.browser.labels.hands import KEYSTROKE_S, Hand, Labels, begin, is_at, is_saved
from tests.browser.looks import pixels, repainted

FRAMES = range(414, 426)
COUNT = len(FRAMES)
WHOLE_ONLY = {"precision, %", "recall, %", "MOTA, %", "IDF1, %", "HOTA, %"}
"""Figures of frames in which every vehicle is labelled."""
BUILD = Path(__file__).resolve().parents[3] / "build"


@pytest.fixture(scope="module")
def clip(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """URI of a folder with only these Astyx frames, as links."""
    folder = tmp_path_factory.mktemp("astyx")
    for part in (each for each in (data_dir / "astyx").iterdir() if each.is_dir()):
        (folder / part.name).mkdir()
        for file in part.iterdir():
            if int(file.stem) in FRAMES:
                (folder / part.name / file.name).symlink_to(file)
    return f"astyx:{folder}"


@pytest.fixture(scope="module")
def astyx(clip: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    engine = Engine(
        open_source,
        detector_for,
        Params(),
        uri=clip,
        whole_drives=True,
        recorder=SessionRecorder(tmp_path_factory.mktemp("sessions")),
    )
    engine.start()
    running = Site(engine, 0)
    running.start()
    engine.wait_for(lambda s: s.drive.done == s.drive.total == COUNT, 300)
    engine.control.change(playing=False, target=0)
    engine.wait_for(lambda s: s.index == 0 and not s.playing, 60)
    yield running
    running.stop()
    engine.stop()


@pytest.fixture(scope="module")
def objects(clip: str) -> list[tuple[TruthObject, ...]]:
    """The objects in each frame, by the labels of Astyx."""
    source = open_source(clip)
    return [source.truth(index) or () for index in range(COUNT)]


@pytest.fixture(scope="module")
def truth(objects: list[tuple[TruthObject, ...]]) -> list[Cuboid]:
    """True position of the car ahead."""
    return [ahead(each).cuboid for each in objects]


def ahead(objects: tuple[TruthObject, ...]) -> TruthObject:
    within = [each for each in objects if abs(each.cuboid.center[1]) < 1.5 and each.cuboid.center[0] > 0]
    return min(within, key=lambda each: each.cuboid.center[0])


def wait_for_frame(page: Page, index: int) -> None:
    expect(page.locator("#transport .where .dim")).to_have_text(f"{index + 1}/{COUNT}")


def errors_m(labels: Labels, track: int, truth: list[Cuboid]) -> dict[str, float]:
    """Distances of the labelled car from the true one in all its frames: of its centre, and of its rear face."""
    held = [labels.cuboid(track, index) for index in range(COUNT)]
    assert all(each is not None for each in held), "it is labelled in every frame"
    middle = [
        np.hypot(*np.subtract(each["center"][:2], true.center[:2])) for each, true in zip(held, truth, strict=True)
    ]
    rear = [
        abs(each["center"][0] - each["size"][0] / 2 - true.center[0] + true.size[0] / 2)
        for each, true in zip(held, truth, strict=True)
    ]
    length = [abs(each["size"][0] - true.size[0]) for each, true in zip(held, truth, strict=True)]
    return {
        "middle_mean": round(float(np.mean(middle)), 3),
        "middle_max": round(float(np.max(middle)), 3),
        "rear_mean": round(float(np.mean(rear)), 3),
        "length_mean": round(float(np.mean(length)), 3),
    }


def judge_the_rest(hand: Hand, labels: Labels, objects: list[tuple[TruthObject, ...]]) -> None:
    """Go through the remaining tracks in the list of work: accept real vehicles and reject the others. A track with a
    box in the image counts as real, since the camera has classified it."""
    page = hand.page
    page.get_by_role("button", name="To do", exact=True).click()
    page.get_by_label("Minimum confidence of proposals").fill("0")
    left = sorted(number for number, track in labels.tracks.items() if track["state"] == "proposed")
    seen: dict[int, list[bool]] = {number: [] for number in left}
    for index, rows in labels.get(f"/frames?first=0&last={COUNT - 1}")["sightings"].items():
        for each in rows:
            if each["cuboid"] is not None and each["track"] in seen:
                seen[each["track"]].append(on_a_vehicle(each["cuboid"], objects[int(index)]))
    expect(page.locator(".track-row")).to_have_count(len(left))  # the list has followed the slider
    for number in left:
        press_row(hand, page.locator(f".track-row[data-id='{number}']"))
        is_one = sum(seen[number]) * 2 >= len(seen[number])
        hand.keys("a" if is_one else "r")
        state = "accepted" if is_one else "rejected"
        labels.wait_for(lambda now, number=number, state=state: now.tracks[number]["state"] == state)
        expect(page.locator(f".track-row[data-id='{number}']:not(.is-gone)")).to_have_count(0)
    expect(page.locator(".label-tracks")).to_contain_text("Nothing left to do.")


def press_row(hand: Hand, row: Locator) -> None:
    """Press a row until it is selected: the list settles a moment after the pointer has left it, and a row that was
    aimed at may then show another track. A person sees that and presses again, which counts."""
    hand.counts["acts"] += 1
    while row.get_attribute("aria-selected") != "true":
        row.click()
        hand.counts["presses"] += 1
        hand.page.wait_for_function("() => new Promise((done) => requestAnimationFrame(() => done(true)))")


def on_a_vehicle(cuboid: Any, objects: tuple[TruthObject, ...]) -> bool:
    return any(np.hypot(*np.subtract(cuboid["center"][:2], true.cuboid.center[:2])) < 2.5 for true in objects)


def score_of(page: Page, labels: Labels) -> dict[str, str]:
    """Values in the Score tab for the current run, by title."""
    page.get_by_role("tab", name="Score").click()
    expect(page.locator(".label-score")).to_have_attribute("data-revision", str(labels.everything["revision"]))
    rows = page.locator(".label-score .comparison table:not(.errors) tbody tr")
    expect(rows.first).to_be_visible()
    return {row.locator("th").inner_text(): row.locator("td").last.inner_text() for row in rows.all()}


def exported_score(engine: Engine, labels: Labels) -> dict[str, str]:
    """The same figures, computed from the exported labels."""
    known = of_labels(from_json(json.dumps(labels.get("/export?format=native")).encode(), "the export"), RULE)
    run = engine.labels.recording.runs.current
    assert run is not None
    score = score_drive(results_of(run), known, Rules(RULE))
    values = {f"{each.title}, {each.unit}": each.of([score]) for each in FIGURES}
    return {
        name: f"{value:.{0 if float(value).is_integer() else 2}f}"
        for name, value in values.items()
        if value is not None
    }


def work(hand: Hand, started: float, errors: dict[str, float]) -> dict[str, Any]:
    return {
        **hand.counts,
        "hands_per_frame": round(sum(hand.counts[name] for name in ("keys", "presses", "drags")) / COUNT, 2),
        "machine_s_per_frame": round((time.monotonic() - started) / COUNT, 3),
        "modelled_person_s_per_frame": round(hand.modelled_s / COUNT, 2),
        "error_m": errors,
    }


def from_proposals(hand: Hand, labels: Labels, truth: list[Cuboid]) -> tuple[int, dict[str, float]]:
    """The pipeline has found the car's rear in every frame, but a LiDAR behind it cannot see its length: the front is
    drawn in one frame, and that size is used for all. Returns the lead, and the errors of the proposals."""
    page = hand.page
    hand.keys("p")
    labels.wait_for(lambda now: len(now.leads) > 0)
    lead = labels.leads[0][2]
    assert isinstance(lead, int)
    held = labels.get(f"/frames?first=0&last={COUNT - 1}")["sightings"].values()
    called = {number: track["label"] for number, track in labels.tracks.items()}
    for row in (row for rows in held for row in rows if row["cuboid"] is not None):
        largest = largest_size_m(called[row["track"]])
        assert all(np.less_equal(row["cuboid"]["size"], largest)), "a hedge is no car"
    as_proposed = errors_m(labels, lead, truth)
    proposed = labels.cuboid(lead, 0)
    row = page.locator(f".track-row[data-id='{lead}']")
    expect(row).to_be_visible()
    x, y = proposed["center"][:2]
    hand.press(hand.plan(x, y))
    expect(row).to_have_attribute("aria-selected", "true")
    front = x + proposed["size"][0] / 2
    rear = x - proposed["size"][0] / 2
    hand.drag(hand.plan(front + 0.8, y), hand.plan(rear + truth[0].size[0], y))
    labels.wait_for(lambda now: now.tracks[lead]["keyframes"] == [0])
    size = labels.cuboid(lead, 0)["size"]
    assert size[0] == pytest.approx(truth[0].size[0], abs=0.3), "as long as it was drawn"
    hand.keys("w")
    labels.wait_for(lambda now: all(now.cuboid(lead, at)["size"] == pytest.approx(size) for at in range(COUNT)))
    hand.keys("a", "Escape", "a")
    labels.wait_for(lambda now: {each["state"] for each in now.everything["leads"]} == {"accepted"})
    return lead, as_proposed


def from_nothing(hand: Hand, labels: Labels, truth: list[Cuboid]) -> int:
    """Drawn in the first frame and corrected in a few others, with interpolation between them."""
    page = hand.page
    first = truth[0]
    hand.keys("g")
    rear, front = (first.center[0] + sign * first.size[0] / 2 for sign in (-1, 1))
    hand.drag(hand.plan(rear, first.center[1]), hand.plan(front, first.center[1]))
    labels.wait_for(lambda now: len(now.tracks) == 1)
    (made,) = labels.tracks
    hand.keys("i")
    at = 0
    for frame in (4, 8, COUNT - 1):
        hand.keys(*["f"] * (frame - at))
        is_at(page, frame)
        hand.keys("k")
        labels.wait_for(lambda now, frame=frame: now.cuboid(made, frame) is not None)
        held, true = labels.cuboid(made, frame), truth[frame]
        hand.drag(hand.plan(*held["center"][:2]), hand.plan(*true.center[:2]))
        labels.wait_for(
            lambda now, frame=frame, true=true: abs(now.cuboid(made, frame)["center"][0] - true.center[0]) < 0.3
        )
        at = frame
    hand.keys("c")
    labels.wait_for(lambda now: now.leads == [(0, COUNT - 1, made)])
    return made


def tag_all(hand: Hand, labels: Labels) -> None:
    """All frames are marked as completely labelled with one key, which is undone and redone."""
    page = hand.page
    notes = page.locator(".label-score .notes")
    assert not score_of(page, labels).keys() & WHOLE_ONLY
    expect(notes).to_contain_text(f"in 0 of {COUNT} labelled frames")
    page.keyboard.press("Home")
    is_at(page, 0)
    bare = pixels(page, "#timeline-back")
    hand.keys("i")
    page.keyboard.press("End")
    is_at(page, COUNT - 1)
    hand.keys("o", "Shift+W")
    labels.wait_for(lambda now: now.tags == [(0, COUNT - 1, "all labelled")])
    assert repainted(page, "#timeline-back", bare), "it is on the timeline"
    assert score_of(page, labels).keys() >= WHOLE_ONLY
    expect(notes).not_to_contain_text("Detection and tracking")
    page.get_by_role("tab", name="Frame").click()
    expect(page.get_by_role("button", name="All labelled", exact=True)).to_have_attribute("aria-pressed", "true")
    hand.keys("Shift+W")
    labels.wait_for(lambda now: now.tags == [(0, COUNT - 2, "all labelled")])
    hand.keys("Control+z", "Control+z")
    labels.wait_for(lambda now: now.tags == [])
    page.get_by_role("tab", name="Tracks").click()


def test_the_drive_is_labelled_with_and_without_proposals(
    astyx: Site, objects: list[tuple[TruthObject, ...]], truth: list[Cuboid], open_page: OpenPage
):
    page = open_page(address=astyx.address)
    labels = Labels(page, astyx.address)
    wait_for_frame(page, 0)

    hand, started = begin(page), time.monotonic()
    made = from_nothing(hand, labels, truth)
    is_saved(page)
    without = work(hand, started, errors_m(labels, made, truth))
    tag_all(hand, labels)
    labels.clear(COUNT)
    page.keyboard.press("Escape")
    page.keyboard.press("Home")
    is_at(page, 0)
    expect(page.locator(".track-row")).to_have_count(0)

    hand, started = Hand(page), time.monotonic()
    lead, as_proposed = from_proposals(hand, labels, truth)
    is_saved(page)
    proposed = work(hand, started, errors_m(labels, lead, truth))
    assert labels.tracks[lead]["state"] == "corrected"
    assert labels.leads == [(0, COUNT - 1, lead)], "the car ahead leads in every frame"
    assert proposed["error_m"]["middle_max"] < 0.6
    assert without["error_m"]["middle_max"] < 0.6
    assert proposed["hands_per_frame"] < without["hands_per_frame"]

    BUILD.mkdir(exist_ok=True)
    report = {
        "frames": COUNT,
        "from_nothing": without,
        "from_proposals": proposed | {"error_m_as_proposed": as_proposed},
        "keystroke_level_model_s": KEYSTROKE_S,
    }
    (BUILD / "labeling.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    (BUILD / "screens").mkdir(exist_ok=True)
    pixels(page, "#timeline-back")
    page.screenshot(path=BUILD / "screens" / "labeling_astyx.png")

    partly = score_of(page, labels)
    assert float(partly["CIPV correct, %"]) == 100.0
    assert not partly.keys() & WHOLE_ONLY, "nobody has said yet what the other tracks are"
    expect(page.locator(".label-score .notes")).to_contain_text(f"in 0 of {COUNT} labelled frames")
    page.get_by_role("tab", name="Tracks").click()
    judge_the_rest(hand, labels, objects)
    figures = score_of(page, labels)
    assert float(figures["CIPV correct, %"]) == 100.0
    assert figures.keys() >= WHOLE_ONLY
    assert float(figures["precision, %"]) < 100.0, "what was rejected is claimed falsely"
    assert figures == exported_score(astyx.engine, labels), "the exported file says the same"
    notes = page.locator(".label-score .notes")
    expect(notes).not_to_contain_text("Detection and tracking")
    expect(notes).to_contain_text("labelled positions are unchanged proposals")
    every = page.locator(".label-score .errors tr[data-vehicles=all][data-seen=any] td")
    assert int(every.first.inner_text()) >= COUNT, "each frame has its lead at least"
    assert page.locator(".label-score").evaluate("(pane) => pane.scrollWidth <= pane.clientWidth"), (
        "no column is cut off"
    )
    worst = page.locator(".worst button").first
    worst.click()
    is_at(page, int(worst.get_attribute("data-frame") or -1))
    page.screenshot(path=BUILD / "screens" / "labeling_score.png")

    with page.expect_download() as download:
        page.locator("#label-pane").get_by_role("button", name="Export").click()
        page.locator("#menu").get_by_text("CSV").click()
    rows = list(csv.DictReader(download.value.path().read_text(encoding="utf-8").splitlines()))
    assert [(row["lead"], row["state"]) for row in rows] == [(str(lead), "accepted")] * COUNT
    ranges = [float(np.hypot(*closest_on_polygon(cuboid.footprint()))) for cuboid in truth]
    assert [float(row["distance_m"]) for row in rows] == pytest.approx(ranges, abs=0.6)
