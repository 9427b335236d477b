"""The results of the pipeline on the embedded drive, as last reviewed and found right.

A change that moves these numbers must be looked at; then `CIPV_UPDATE_GOLDEN=1 pytest tests/golden` writes them anew.
Numbers are compared within what another processor's rounding may do, decisions exactly.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from itertools import tee
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.common.geometry import closest_on_polygon
from pipeline.detection import Detectors, detector_for
from pipeline.params import preset
from pipeline.run import through
from pipeline.simulation import scenario
from pipeline.simulation.world import world_state
from pipeline.sources import open_source
from pipeline.types.result_json import to_json

FOLDER = Path(__file__).parent
EVERY = 5


@pytest.fixture(scope="module")
def drive() -> dict[str, list[dict[str, Any]]]:
    """Results of each preset with the LiDAR alone, and of the default one with both sensors. Rendering takes most of
    the time, so all three share it."""
    source = open_source("sim:straight")
    lines = {
        "default": ("default", Detectors()),
        "paper": ("paper", Detectors()),
        "both sensors": ("default", Detectors(detector_for(source))),
    }
    copies = tee((source.frame(index) for index in range(len(source))), len(lines))
    runs = [through(frames, preset(name), seen) for frames, (name, seen) in zip(copies, lines.values(), strict=True)]
    results = [[to_json(result) for _, result in side_by_side] for side_by_side in zip(*runs, strict=True)]
    return {name: [row[place] for row in results] for place, name in enumerate(lines)}


def summary(results: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Every fifth frame: the lead, its distance, the reason, and the ACC command."""
    return [_decisions(each) for each in results[::EVERY]]


def _decisions(full: dict[str, Any]) -> dict[str, Any]:
    """Without object ids: one more roadside cluster, on another processor, would shift them all."""
    lead, command = full["cipv"] or {}, full["acc"]
    return {
        "frame": full["frame"],
        "cipv": {key: lead[key] for key in lead if key != "id"},
        "acc": {key: command[key] for key in command if key not in ("reason", "object_id")},
        "in_path_m": [item["distance_m"] for item in full["objects"] if item["in_path"]],
    }


@pytest.mark.parametrize("name", ["default", "paper"])
def test_golden(drive: dict[str, list[dict[str, Any]]], name: str) -> None:
    file, now = FOLDER / f"straight_{name}.json", summary(drive[name])
    if os.environ.get("CIPV_UPDATE_GOLDEN"):
        file.write_text("[\n" + ",\n".join(json.dumps(row) for row in now) + "\n]\n", encoding="utf-8")
    golden = json.loads(file.read_text(encoding="utf-8"))
    assert len(now) == len(golden)
    for ours, theirs in zip(now, golden, strict=True):
        assert same(ours, theirs), f"frame {ours['frame']}:\n{ours}\nwas\n{theirs}"


def same(a: Any, b: Any) -> bool:
    """Whether both are equal, floats to the centimetre."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return a == pytest.approx(b, abs=0.01, rel=0.002)
    return bool(a == b)


def test_nothing_brakes_hard_on_a_drive_that_needs_none(drive: dict[str, list[dict[str, Any]]]) -> None:
    """With both sensors and the embedded detector, neither ACC's TTC rule nor emergency braking reacts to a phantom."""
    commands = {result["frame"]: result["acc"] for result in drive["both sensors"]}
    assert len(commands) == 200
    phantoms = {frame: c["reason"] for frame, c in commands.items() if c["state"] not in ("cruise", "follow")}
    assert not phantoms


SAME_PLACE_M = 1.0


def test_speeds_over_ground_are_known_as_well_as_is_said(drive: dict[str, list[dict[str, Any]]]) -> None:
    """Two standard deviations hold nine of ten errors of what both sensors see. Of what the camera alone sees, they
    hold fewer: most of the others are of a single vehicle, 90 m ahead, for two seconds."""
    scene, held, counted = scenario.load("straight"), Counter[str](), Counter[str]()
    for result in drive["both sensors"]:
        actors = world_state.at(scene, result["t_ns"] / 1e9).actors
        places = np.array([closest_on_polygon(actor.cuboid.footprint()) for actor in actors])
        for item in result["objects"]:
            if item["speed_over_ground_sigma_mps"] is None or item["carried"]:
                continue
            away_m = np.hypot(*(places - item["closest_point"][:2]).T)
            if np.sum(away_m < SAME_PLACE_M + 2.0 * item["distance_sigma_m"]) == 1:
                error_mps = item["speed_over_ground_mps"] - actors[int(away_m.argmin())].speed_mps
                counted[item["source"]] += 1
                held[item["source"]] += abs(error_mps) <= 2.0 * item["speed_over_ground_sigma_mps"]
    assert min(counted["V"], counted["VL"]) > 100
    assert held["V"] / counted["V"] >= 0.8
    assert held["VL"] / counted["VL"] >= 0.9
