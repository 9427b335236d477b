"""What the sensors cannot know is proposed as such: single moments of Astyx, in which nobody is ahead as far as the
path is known, and every vehicle is seen only for a moment."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from app.drive.frame_rows import lead_reach_m
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.detection import detector_for
from pipeline.labels.model import FARTHEST_LEAD_M
from pipeline.params import Params
from pipeline.sources import open_source
from tests.browser.conftest import Pages, Site, opening
from tests.browser.labels.hands import Labels, begin, is_saved

FRAMES = ("000047", "000048", "000049")


@pytest.fixture
def moments(data_dir: Path, tmp_path: Path) -> Iterator[Site]:
    folder = tmp_path / "moments"
    for part in (each for each in (data_dir / "astyx").iterdir() if each.is_dir()):
        (folder / part.name).mkdir(parents=True)
        for file in (each for each in part.iterdir() if each.stem in FRAMES):
            (folder / part.name / file.name).symlink_to(file)
    desk = SessionRecorder(tmp_path / "sessions")
    engine = Engine(open_source, detector_for, Params(), uri=f"astyx:{folder}", whole_drives=True, recorder=desk)
    engine.start()
    running = Site(engine, 0)
    running.start()
    engine.wait_for(lambda s: s.drive.done == s.drive.total == len(FRAMES), 300)
    engine.control.change(playing=False, target=0)
    engine.wait_for(lambda s: s.index == 0 and not s.playing and s.processed is not None, 60)
    yield running
    running.stop()
    engine.stop()


def test_beyond_reach_the_lead_is_unclear_and_what_was_seen_once_is_a_box(pages: Pages, moments: Site) -> None:
    tick = moments.engine.snapshot.processed
    assert tick is not None
    assert tick.result.cipv is None, "an empty road, as far as the path is known"
    assert lead_reach_m(tick.frame, tick.result) < FARTHEST_LEAD_M
    with opening(pages, moments) as open_page:
        page = open_page()
        labels, hand = Labels(page, moments.address), begin(page)
        hand.keys("p")
        labels.wait_for(lambda now: len(now.leads) > 0)
        is_saved(page)
        assert labels.leads == [(0, len(FRAMES) - 1, "unknown")], "not that nothing is ahead"
        expect(page.get_by_role("button", name="unclear", exact=True)).to_have_attribute("aria-pressed", "true")
        rows = labels.get(f"/frames?first=0&last={len(FRAMES) - 1}")["sightings"]
        lives = [each["track"] for there in rows.values() for each in there]
        once = [each for there in rows.values() for each in there if lives.count(each["track"]) == 1]
        assert all(each["cuboid"] is None and each["bbox"] is not None for each in once)
        placed = [each.bbox for each in tick.result.objects if each.cuboid is not None and each.bbox is not None]
        assert [each for each in once for box in placed if each["bbox"] == pytest.approx(box, abs=0.01)], (
            "one of them had a cluster in its box, too"
        )
        page.get_by_role("button", name="All", exact=True).click()
        page.get_by_label("Minimum confidence of proposals").fill("0")
        expect(page.locator(".track-row")).to_have_count(len(labels.tracks))
