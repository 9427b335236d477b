"""A kept drive's page, opened from disk: its link into the dashboard says where the drive lies and how it drove."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from playwright.sync_api import Browser

from app.reports.experiment_drives import ReplayFolder
from pipeline.experiments.experiment import ExperimentDrive
from pipeline.experiments.iso15622.experiment import ISO
from pipeline.experiments.straight_track import parameters
from pipeline.simulation import scenario
from pipeline.sources import open_source


def test_the_link_holds_place_and_parameters_after_a_move(browser: Browser, tmp_path: Path) -> None:
    folder = ReplayFolder(tmp_path / "made")
    params = parameters("AEB", 20.0)
    folder.keep(ISO, ExperimentDrive("a+b_0", "A drive", ("Passed.",), scenario.load("straight"), params, "lidar", ()))
    folder.list_all()
    moved = (tmp_path / "made").rename(tmp_path / "mine & #2, 100 %")
    page = browser.new_page()
    page.goto((moved / "index.html").as_uri())
    page.click("text=A drive")
    link = page.get_attribute("#open a", "href")
    assert page.is_visible("#open")
    assert link is not None
    shared = parse_qs(urlsplit(link).fragment, strict_parsing=True)
    page.close()
    (uri,), (preset,), (values,) = shared["uri"], shared["preset"], shared["params"]
    assert uri == f"sim:{moved / 'a+b_0.yaml'}"
    assert len(open_source(uri)) == scenario.load("straight").frame_count()
    assert preset == "default"
    assert json.loads(values) == {"acc.set_speed_kmh": 72.0, "acc.brake_limit_mps2": 0.0}
