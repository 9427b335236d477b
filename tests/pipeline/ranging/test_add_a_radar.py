"""A radar is added by a module and one entry in ``SENSOR_KINDS``: simulator, sessions, fusion, evidence, braking,
results and scores then know it. Here, the module is ``radar.py`` beside this file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.drive.frame_rows import object_json, objects_of
from pipeline.detection import Detectors
from pipeline.evaluation.scores.results_file import read_results
from pipeline.params import Params
from pipeline.recording.rewrite import clip
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from pipeline.run import only, run
from pipeline.sources import open_source
from pipeline.types import Braking, Frame, FusedObject, Result
from pipeline.types.result_json import to_json, to_line
from pipeline.types.source import Source
from tests.pipeline.ranging.declared import radar_declared
from tests.pipeline.recording.frames import ABOUT, same

SCENARIO = """
title: Towards a standing car
seed: 21
duration_s: 4
road: {segments: [{length_m: 3000}], lane_width_m: 3.5, lanes_forward: 2}
ego: {lane: -2, speed_mps: {0: 27.78}}
sensors: lidar
further_sensors: [radar]
actors:
  - {id: 1, kind: car, colour: "#c7c9cc", lane: -2, ahead_m: 115, speed_mps: {0: 0}}
"""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Source]:
    """100 km/h towards a standing car, which the LiDAR sees from about 35 m on."""
    file = tmp_path_factory.mktemp("radar") / "standing.yaml"
    file.write_text(SCENARIO, encoding="utf-8")
    with radar_declared():
        yield open_source(f"sim:{file}")


@pytest.fixture(scope="module")
def frames(drive: Source) -> list[tuple[Frame, Result]]:
    """The whole drive."""
    return list(run(drive, Params(), Detectors()))


def car_in(result: Result, away_m: float) -> FusedObject | None:
    """The object at the true distance of the standing car."""
    near = [each for each in result.objects if each.distance_m is not None and abs(each.distance_m - away_m) < 2.0]
    return min(near, key=lambda each: abs(each.closest_point[1]) if each.closest_point else 99.0, default=None)


def true_m(source: Source, index: int) -> float:
    (car,) = source.truth(index) or ()
    return float(np.hypot(*car.cuboid.footprint()[:, :2].T).min())


def test_it_sees_farther_than_the_lidar_and_knows_the_speed_at_once(
    drive: Source, frames: list[tuple[Frame, Result]]
) -> None:
    found = [car_in(result, true_m(drive, index)) for index, (_, result) in enumerate(frames)]
    assert all(found), "in every frame"
    cars = [each for each in found if each is not None]
    assert {each.id for each in cars} == {cars[0].id}, "one object, whichever sensors see it"
    assert cars[0].source == "R"
    assert cars[-1].source == "LR"
    assert cars[0].distance_from == "radar"
    assert cars[-1].distance_from == "cluster"
    assert cars[0].velocity_mps is not None
    assert cars[0].velocity_mps[0] == pytest.approx(-27.78, abs=0.5)
    assert cars[4].existence is not None
    assert cars[4].existence > 0.9
    assert cars[4].ranged_hits == 5


def test_it_is_the_lead_and_may_be_braked_for(drive: Source, frames: list[tuple[Frame, Result]]) -> None:
    without = [(frame, result) for frame, result in run(drive, Params(), Detectors(), "lidar")]
    leads = [result.cipv is not None for _, result in frames]
    assert leads.index(True) < [result.cipv is not None for _, result in without].index(True)
    first = frames[leads.index(True)][1]
    assert first.cipv is not None
    assert first.cipv.reason.startswith("obstacle seen by radar only")
    lead = first.chosen()
    assert lead is not None
    assert lead.justifies is Braking.FULL


def test_results_name_it_and_are_read_back(frames: list[tuple[Frame, Result]], tmp_path: Path) -> None:
    content = to_json(frames[0][1])
    assert content["sensors"]["radar"] == {"age_ms": 0.0, "points": 1}
    (tmp_path / "results.jsonl").write_text("".join(to_line(result) for _, result in frames), encoding="utf-8")
    assert {each.source for result in read_results(tmp_path / "results.jsonl") for each in result.objects} >= {
        "R",
        "LR",
    }


def test_a_timeline_stores_its_source(frames: list[tuple[Frame, Result]]) -> None:
    _, result = frames[0]
    number = next(each.id for each in result.objects if each.source == "R")
    assert object_json([(0, objects_of(result))], number)["source"] == ["R"]


def test_a_session_stores_its_scans(frames: list[tuple[Frame, Result]], tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path / "drive.mcap", ABOUT)
    for frame, result in frames:
        writer.write(frame, result)
    writer.close()
    session = SessionSource("", str(tmp_path / "drive.mcap"))
    assert all(same(session.frame(index).scans, frame.scans) for index, (frame, _) in enumerate(frames))
    again = [json.loads(to_line(result)) | {"timing_ms": 0} for _, result in run(session, Params(), Detectors())]
    assert again == [json.loads(to_line(result)) | {"timing_ms": 0} for _, result in frames]
    clip(session, 10, 20, tmp_path / "clip.mcap")
    assert same(SessionSource("", str(tmp_path / "clip.mcap")).frame(0).scans, frames[10][0].scans)


def test_one_sensor_alone_is_without_it(drive: Source) -> None:
    assert not only(drive.frame(0), "lidar").scans
    assert not only(drive.frame(0), "camera").scans
