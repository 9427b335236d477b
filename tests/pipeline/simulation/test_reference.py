"""The reference of scenario files agrees with the code: every key, every default, and an example that runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel

from pipeline.simulation import scenario
from pipeline.simulation.drawing.lens import CameraModel
from pipeline.simulation.scenario import Ego, Scenario
from pipeline.simulation.sensors.detection_model import BoxNoise, Detections, LineNoise
from pipeline.simulation.sensors.faults import Faults, Knock
from pipeline.simulation.sensors.gnss_model import GnssModel, OdometryModel
from pipeline.simulation.sensors.lidar.model import LidarModel
from pipeline.simulation.world.actors import Actor, Brake
from pipeline.simulation.world.free_ways import FreeActor, WayPiece
from pipeline.simulation.world.intersection_ways import CrossingActor
from pipeline.simulation.world.roads import Beacon, Crossing, Road, Segment, Strip

TEXT = (Path(scenario.__file__).parent / "scenarios" / "README.md").read_text(encoding="utf-8")
PARTS: dict[str, type[BaseModel]] = {
    "scenario": Scenario,
    "road": Road,
    "segment": Segment,
    "crossing": Crossing,
    "strip": Strip,
    "beacon": Beacon,
    "ego": Ego,
    "actor": Actor,
    "crossing_actor": CrossingActor,
    "free_actor": FreeActor,
    "way_piece": WayPiece,
    "brake": Brake,
    "camera": CameraModel,
    "lidar": LidarModel,
    "gnss": GnssModel,
    "odometry": OdometryModel,
    "detections": Detections,
    "boxes": BoxNoise,
    "lines": LineNoise,
    "faults": Faults,
    "knock": Knock,
}


def documented(part: str) -> dict[str, str]:
    """Default by key, as in the table."""
    body = TEXT.split(f"\n## {part}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| ([a-z0-9_, ]+) \| ([^|]*)\|", body, re.MULTILINE)
    return {key: default.strip() for keys, default in rows for key in keys.split(", ") if key != "key"}


def test_no_part_is_left_out() -> None:
    assert re.findall(r"^## (.+)$", TEXT, re.MULTILINE) == list(PARTS)


@pytest.mark.parametrize("part", PARTS)
def test_every_key_has_its_default(part: str) -> None:
    fields, told = PARTS[part].model_fields, documented(part)
    assert set(told) == set(fields)
    for key, default in told.items():
        if fields[key].is_required():
            assert default == "", key
        else:
            usual = fields[key].default
            plain = usual.model_dump(exclude_defaults=True) if isinstance(usual, BaseModel) else usual
            assert yaml.safe_load(default) == (list(plain) if isinstance(plain, tuple) else plain), key


def test_the_example_plays() -> None:
    example = TEXT.split("```yaml\n")[1].split("```")[0]
    scene = scenario.parse(example, "README.md")
    assert scene.actors[0].brake is not None
