"""`cipv export` and the dashboard give the same clip: object numbers are those of `cipv run`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from app.cli import main
from app.clips.clip import Clip
from app.clips.exports import write_clip
from pipeline.common.progress import silent
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.sources import open_source

SCENARIO = "sim:cut_in"
"""Objects appear and disappear, so ids assigned from a later start would differ."""
FIRST, LAST = 15, 17
Numbers = list[tuple[str, int, str]]


def cipv(*arguments: object) -> None:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert not end.value.code


def of_table(path: Path) -> Numbers:
    with path.open(encoding="utf-8", newline="") as file:
        return [(row["frame"], int(row["id"]), row["distance_m"]) for row in csv.DictReader(file) if row["id"]]


def of_results(path: Path) -> Numbers:
    results = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [
        (result["frame"], each["id"], "" if each["distance_m"] is None else str(each["distance_m"]))
        for result in results[FIRST : LAST + 1]
        for each in result["objects"]
    ]


def test_the_command_the_dashboard_and_a_whole_run_agree(tmp_path: Path) -> None:
    alone = ("--detector", "embedded", "--lanes", "off")
    cipv("run", SCENARIO, "--frames", LAST + 1, "--out", tmp_path / "run.jsonl", *alone)
    expected = of_results(tmp_path / "run.jsonl")
    assert len({number for _, number, _ in expected}) > 1

    source = open_source(SCENARIO)
    start_s, end_s = ((source.t_ns(index) - source.t_ns(0)) / 1e9 for index in (FIRST, LAST))
    cipv("export", SCENARIO, "--from", start_s, "--to", end_s, "--csv", tmp_path / "command.csv", *alone)
    assert of_table(tmp_path / "command.csv") == expected


def test_the_dashboards_clip_is_the_commands(tmp_path: Path) -> None:
    """With the LiDAR alone, since ids can be compared without a network."""
    source = open_source(SCENARIO)
    write_clip(Clip.of_source(source, Params(), FIRST, LAST, Detectors()), "csv", tmp_path / "page.csv", silent)
    cipv("run", SCENARIO, "--frames", LAST + 1, "--out", tmp_path / "run.jsonl", "--sensors", "lidar")
    assert of_table(tmp_path / "page.csv") == of_results(tmp_path / "run.jsonl")
