"""``to_json`` against the field lists of docs/reference/results.md, in both directions, and against what must never be
in a file."""

from __future__ import annotations

import dataclasses
import io
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.geometry import Cuboid
from pipeline.types import (
    AccCommand,
    Cipv,
    EgoState,
    Frame,
    FusedObject,
    Gate,
    Layers,
    MotionEstimate,
    OwnMotion,
    Path,
    RawBoxes,
    RawLanes,
    Rejection,
    Result,
    SensorHealth,
)
from pipeline.types.result_json import to_json, to_line, write_line

FIELDS = {
    "": "version frame t_ns sensors ego own_motion objects path cipv next_cipv rejected acc notes timing_ms",
    "sensors": "lidar camera ego",
    "sensors.lidar": "age_ms points",
    "sensors.camera": "age_ms skew_ms far_view lanes_age_ms lanes_far_view",
    "sensors.ego": "age_ms",
    "ego": "speed_mps yaw_rate_radps",
    "own_motion": "speed_from speed_sigma_mps yaw_rate_from yaw_rate_sigma_radps pose sources",
    "own_motion.sources.0": "source speed_mps yaw_rate_radps",
    "objects.0": "id source type type_score bbox bev cuboid closest_point distance_m distance_sigma_m distance_from "
    "height_from velocity_mps "
    "speed_over_ground_mps speed_over_ground_sigma_mps in_path existence_probability in_path_probability path_offset_m "
    "lateral_mps crossing_s moving ttc_s carried "
    "seen_by hits lidar_points gates",
    "objects.0.cuboid": "center size yaw_rad",
    "objects.0.gates.0": "name value limit passed",
    "path": "source center left right sigma_m weights carried_by reach_m usable confidence",
    "cipv": "id distance_m closing_speed_mps ttc_s reason accel_mps2 accel_sigma_mps2",
    "rejected.0": "id reason",
    "acc": "state desired_speed_mps accel_mps2 accelerator brake reason object_id",
}
SHAPES = {"bbox": (4,), "bev": (4, 2), "closest_point": (3,), "velocity_mps": (2,)}


LIDAR = MotionEstimate("lidar", 15.0, 0.2, 0.01, 0.005)


def whole_result() -> Result:
    lead = FusedObject(
        id=7,
        source="VL",
        label="car",
        score=0.912345678,
        bbox=(1.0, 2.0, 30.5, 40.25),
        bev=((20.0, 1.0), (20.0, -1.0), (16.0, -1.0), (16.0, 1.0)),
        cuboid=Cuboid((18.0, 0.0, 0.7), (4.0, 2.0, 1.4), 0.1),
        closest_point=(16.0, 0.1, 0.5),
        distance_m=16.000049,
        distance_sigma_m=0.15,
        velocity_mps=(-2.0, 0.0),
        seen_by="VL",
        hits=5,
        lidar_points=40,
        lidar_track=3,
        vision_track=2,
        gates=(Gate("iou", 0.7, 0.1, True),),
        speed_over_ground_mps=13.0,
        speed_over_ground_sigma_mps=0.4,
        moving=True,
        ttc_s=8.0,
        in_path=True,
        in_path_probability=0.99,
        path_offset_m=-0.00001,
    )
    unknown = FusedObject(
        id=9,
        source="V",
        label="person",
        score=0.5,
        bbox=(0.0, 0.0, 5.0, 9.0),
        bev=None,
        cuboid=None,
        closest_point=None,
        distance_m=None,
        distance_sigma_m=None,
        velocity_mps=None,
        seen_by="",
        hits=1,
        lidar_points=0,
        lidar_track=None,
        vision_track=4,
    )
    line, side = np.array([[0.0, 0.0], [10.0, 0.123456]]), np.array([0.0, 1.5])
    return Result(
        frame="000414",
        t_ns=1_700_000_000_123_456_789,
        sensors=SensorHealth(1.0, 9000, 2.0, 3.0, None),
        ego=EgoState(0, 15.0, 0.01),
        own_motion=OwnMotion(LIDAR, LIDAR, (LIDAR,), (1.0, 2.0, 0.1)),
        objects=(lead, unknown),
        path=Path("straight", line, line + side, line - side, 1.5, {"10": 0.1}, {"straight": 1.0}),
        cipv=Cipv(7, 16.0, 2.0, 8.0, "nearest in path: 16.0 m", -1.5, 0.5),
        rejected=(Rejection(9, "its distance is unknown"),),
        acc=AccCommand("follow", 12.0, -1.0, 0.0, 0.2, "gap below the desired one"),
        notes=("Jalousie offen – prüfen",),
        timing_ms={"ground": 0.05, "total": 3.2},
        layers=Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32)),
    )


def at(data: Any, path: str) -> Any:
    for key in path.split(".") if path else []:
        data = data[int(key)] if key.isdigit() else data[key]
    return data


@pytest.mark.parametrize("path", FIELDS)
def test_fields_are_the_contracts_and_no_others(path: str) -> None:
    assert list(at(to_json(whole_result()), path)) == FIELDS[path].split()


def test_values_arrive_under_their_names() -> None:
    data = to_json(whole_result())
    lead = data["objects"][0]
    assert (lead["source"], lead["type"], lead["type_score"]) == ("VL", "car", 0.9123)
    assert (lead["distance_m"], lead["cuboid"]["yaw_rad"], lead["gates"][0]["name"]) == (16.0, 0.1, "iou")
    assert data["t_ns"] == 1_700_000_000_123_456_789
    assert data["cipv"] == {
        "id": 7,
        "distance_m": 16.0,
        "closing_speed_mps": 2.0,
        "ttc_s": 8.0,
        "reason": "nearest in path: 16.0 m",
        "accel_mps2": -1.5,
        "accel_sigma_mps2": 0.5,
    }
    assert data["path"]["center"] == [[0.0, 0.0], [10.0, 0.1235]]
    assert data["acc"]["reason"] == "gap below the desired one"
    assert data["notes"] == ["Jalousie offen – prüfen"]


@pytest.mark.parametrize(("name", "shape"), SHAPES.items())
def test_shapes(name: str, shape: tuple[int, ...]) -> None:
    assert np.shape(to_json(whole_result())["objects"][0][name]) == shape


def test_what_is_unknown_is_null_and_never_zero() -> None:
    row = to_json(whole_result())["objects"][1]
    unknown = ("bev", "cuboid", "closest_point", "distance_m", "distance_sigma_m", "velocity_mps", "ttc_s", "moving")
    assert [row[name] for name in unknown] == [None] * len(unknown)
    empty = to_json(dataclasses.replace(whole_result(), ego=None, cipv=None, acc=None))
    assert (empty["ego"], empty["cipv"], empty["acc"], empty["next_cipv"]) == (None, None, None, None)


def test_the_far_views_are_those_of_the_networks_outputs() -> None:
    none = np.zeros((0, 4), np.float32)
    boxes = RawBoxes("d", none, none[:, 0], (), far=(400, 0, 816, 375))
    lanes = RawLanes("l", none[:, :2], none[:, 0], np.zeros(0, np.int32), window=(290, 145, 931, 273))
    health = SensorHealth.of(Frame(0, "0", 0, raw_boxes=boxes, raw_lanes=lanes))
    camera = to_json(dataclasses.replace(whole_result(), sensors=health))["sensors"]["camera"]
    assert (camera["far_view"], camera["lanes_far_view"]) == ([400, 0, 816, 375], [290, 145, 931, 273])


def test_minus_zero_is_written_as_zero() -> None:
    assert '"path_offset_m":0.0,' in to_line(whole_result())


@given(bad=st.sampled_from([math.nan, math.inf, -math.inf]), good=st.floats(-1e6, 1e6))
def test_no_infinity_and_no_nan_reach_a_file(bad: float, good: float) -> None:
    result = whole_result()
    lead = dataclasses.replace(
        result.objects[0],
        distance_m=bad,
        ttc_s=bad,
        velocity_mps=(good, bad),
        closest_point=(bad, good, good),
        bev=((good, good), (good, bad), (1.0, 1.0), (2.0, 2.0)),
        cuboid=Cuboid((bad, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0),
    )
    path = dataclasses.replace(result.path, center=np.array([[good, bad], [1.0, 2.0]]), sigma_m={"10": bad})
    line = to_line(dataclasses.replace(result, objects=(lead,), path=path, cipv=Cipv(7, bad, bad, None, "r")))
    data = json.loads(line, parse_constant=lambda word: pytest.fail(f"{word} in the file"))
    row = data["objects"][0]
    names = ("distance_m", "ttc_s", "velocity_mps", "closest_point", "bev", "cuboid")
    assert [row[name] for name in names] == [None] * 6
    assert data["path"]["center"] == [[1.0, 2.0]]
    assert data["path"]["sigma_m"] == {"10": None}
    assert data["cipv"]["distance_m"] is None


def test_lines_are_one_object_each_and_the_same_every_time() -> None:
    stream = io.StringIO()
    write_line(stream, whole_result())
    write_line(stream, whole_result())
    first, second = stream.getvalue().splitlines()
    assert first == second
    assert json.loads(first) == to_json(whole_result())


def test_numpy_numbers_become_plain_ones() -> None:
    lead = dataclasses.replace(whole_result().objects[0], distance_m=np.float32(16.1))  # type: ignore[arg-type]
    assert json.loads(to_line(dataclasses.replace(whole_result(), objects=(lead,))))["objects"][0]["distance_m"] == 16.1
