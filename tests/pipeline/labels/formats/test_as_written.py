"""What is in the files, number by number: a mistake made both ways would come back unnoticed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.formats.kitti_records import UNLABELLED
from pipeline.labels.formats.registry import FormatName, export_labels, import_labels
from pipeline.labels.model import LabelTrack, LeadRange, Origin, Sighting
from tests.pipeline.labels.formats.sets import IMPORT, drive
from tests.pipeline.labels.formats.test_round_trip import full_set


def written(name: FormatName, folder: Path) -> Any:
    export_labels(full_set(), drive(), name, folder / "out")
    return json.loads((folder / "out").read_text())


def test_coco(tmp_path: Path) -> None:
    coco = written("coco", tmp_path)
    assert [each["name"] for each in coco["categories"]] == ["bus", "car"]
    first, second, bus = coco["annotations"]
    assert (bus["track_id"], bus["image_id"]) == (5, 3), "it had no box: around its cuboid's projection"
    assert first["bbox"] == [500.0, 300.0, 200.0, 120.0], "left, top, width, height"
    assert (first["area"], first["iscrowd"], first["track_id"], first["category_id"]) == (24000.0, 0, 3, 2)
    assert [first["image_id"], second["image_id"]] == [1, 2]
    image = coco["images"][1]
    assert (image["id"], image["width"], image["height"], image["frame_index"]) == (2, 1280, 720, 1)


def test_coco_regions_without_labels_are_ignored_by_scores(tmp_path: Path) -> None:
    labels = full_set()
    region = LabelTrack(9, UNLABELLED, (Sighting(1, None, (10.0, 20.0, 60.0, 40.0)),), "accepted", IMPORT)
    export_labels(replace(labels, tracks=(*labels.tracks, region)), drive(), "coco", tmp_path / "out")
    annotations = json.loads((tmp_path / "out").read_text())["annotations"]
    assert {each["track_id"]: each["iscrowd"] for each in annotations} == {3: 0, 5: 0, 9: 1}


def test_openlabel(tmp_path: Path) -> None:
    openlabel = written("openlabel", tmp_path)["openlabel"]
    assert openlabel["metadata"]["schema_version"] == "1.0.0"
    seen = openlabel["frames"]["1"]["objects"]["3"]["object_data"]
    assert seen["cuboid"][0]["val"] == pytest.approx(
        [20.0, 0.0, 0.5, 0.0, 0.0, 0.0499792, 0.9987503, 4.0, 1.8, 1.5], abs=1e-6
    ), "place, x y z w, length width height"
    assert seen["bbox"][0]["val"] == [600.0, 360.0, 200.0, 120.0], "around the centre"
    assert seen["boolean"] == [{"name": "keyframe", "val": False}, {"name": "box_set", "val": True}]
    assert openlabel["objects"]["3"]["frame_intervals"] == [{"frame_start": 0, "frame_end": 1}]
    relation = openlabel["relations"]["0"]
    assert relation["type"] == "isLeadVehicleOf"
    assert relation["rdf_subjects"] == [{"type": "object", "uid": "3"}]
    assert openlabel["objects"][relation["rdf_objects"][0]["uid"]]["type"] == "ego_vehicle"
    assert "0" in openlabel["frames"]["1"]["relations"]
    assert [index for index in "0123" if "contexts" in openlabel["frames"][index]] == ["0", "1"], "it rains there"
    assert "0" not in openlabel["frames"]["2"].get("relations", {})
    pose = openlabel["coordinate_systems"]["camera"]["pose_wrt_parent"]["matrix4x4"]
    assert [pose[3], pose[7], pose[11]] == pytest.approx([-1.0, 0.1, 1.2]), "where the camera is in the ego frame"


def test_openlabel_of_others(tmp_path: Path) -> None:
    """Nine numbers with Euler angles, its own coordinate system, UUIDs, and a lead given only by a relation."""
    uid = "c44c1fc2-ee48-4b17-a20e-829de9be1141"
    cuboid = {"name": "shape", "val": [10, 1, 0, 0, 0, 0.5, 4, 2, 1.5], "coordinate_system": "lidar"}
    pose = [0, -1, 0, 2, 1, 0, 0, 3, 0, 0, 1, 4, 0, 0, 0, 1]  # turned by a quarter to the left
    content = {
        "metadata": {"schema_version": "1.0.0"},
        "coordinate_systems": {
            "odom": {"type": "scene_cs", "parent": ""},
            "lidar": {"type": "sensor_cs", "parent": "odom", "pose_wrt_parent": {"matrix4x4": pose}},
        },
        "objects": {uid: {"name": "van1", "type": "Van"}, "4": {"name": "ego", "type": "ego_vehicle"}},
        "frames": {"2": {"objects": {uid: {"object_data": {"cuboid": [cuboid]}}}}},
        "relations": {
            "0": {
                "name": "",
                "type": "isLeadVehicleOf",
                "rdf_subjects": [{"type": "object", "uid": uid}],
                "rdf_objects": [{"type": "object", "uid": "4"}],
                "frame_intervals": [{"frame_start": 1, "frame_end": 3}],
            }
        },
    }
    file = tmp_path / "theirs.json"
    file.write_text(json.dumps({"openlabel": content}))
    labels = import_labels(file, drive(), "openlabel", IMPORT).labels
    (track,) = labels.tracks
    assert (track.id, track.label, track.state) == (1, "car", "accepted")
    (sighting,) = track.sightings
    assert sighting.cuboid is not None
    assert sighting.cuboid.center == pytest.approx((1.0, 13.0, 4.0))
    assert sighting.cuboid.yaw_rad == pytest.approx(0.5 + 1.5707963)
    assert labels.leads == (LeadRange(1, 3, 1, "accepted", IMPORT),)


def test_csv_of_the_lead(tmp_path: Path) -> None:
    here, by = drive(), Origin("person", "Ada, B.", 5)
    seen = Sighting(1, Cuboid((20.0, 0.0, 0.5), (4.0, 2.0, 1.5), 0.0))
    labels = replace(
        here.empty(),
        tracks=(LabelTrack(3, "car", (seen,), "accepted", by),),
        leads=(LeadRange(1, 2, 3, "accepted", by), LeadRange(3, 3, "unknown", "proposed", by)),
    )
    export_labels(labels, here, "csv", tmp_path / "lead.csv")
    lines = (tmp_path / "lead.csv").read_text().splitlines()
    assert lines[0].startswith("frame,name,t_ns,lead,state,maker,by,")
    assert lines[1] == "0,000000,1000000000,,,,,,,,,,,,,,", "nobody has said"
    assert lines[2] == '1,000001,1100000000,3,accepted,person,"Ada, B.",5,,,,,,car,18.000,20.000,0.000'
    assert lines[4].startswith("3,000003,1300000000,unknown,proposed,")
    assert len(lines) == 7


def test_a_table_by_hand_needs_two_columns(tmp_path: Path) -> None:
    file = tmp_path / "lead.csv"
    file.write_text("frame,lead\n0,7\n1,7\n2,\n3,none\n")
    leads = import_labels(file, drive(), "csv", IMPORT).labels.leads
    assert leads == (LeadRange(0, 1, 7, "accepted", IMPORT), LeadRange(3, 3, "none", "accepted", IMPORT))


def test_nuscenes_points_in_a_box_are_counted(tmp_path: Path) -> None:
    import numpy as np

    points = np.array([[20, 0, 0.5, 9], [21.9, 0.3, 0.5, 9], [23, 0, 0.5, 9]], dtype=np.float32)
    here = replace(drive(), points=lambda frame: points)
    export_labels(full_set(), here, "nuscenes", tmp_path / "out")
    rows = json.loads((tmp_path / "out/v1.0-cipv/sample_annotation.json").read_text())
    assert [row["num_lidar_pts"] for row in rows] == [2, 2, 2]
    names = {path.stem for path in (tmp_path / "out/v1.0-cipv").iterdir()}
    assert names == {
        "attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map", "sample",
        "sample_annotation", "sample_data", "scene", "sensor", "visibility",
    }  # fmt: skip


def test_nuscenes_rows_name_rows_that_are_there(tmp_path: Path) -> None:
    export_labels(full_set(), drive(), "nuscenes", tmp_path / "out")
    tables = {p.stem: json.loads(p.read_text()) for p in (tmp_path / "out/v1.0-cipv").iterdir()}
    tokens = {name: {row["token"] for row in rows} for name, rows in tables.items()}
    ends = {"first_sample": "sample", "last_sample": "sample"}
    ends |= {"first_annotation": "sample_annotation", "last_annotation": "sample_annotation"}
    checked = 0
    for name, rows in tables.items():
        assert len(tokens[name]) == len(rows)
        for row in rows:
            for key, value in row.items():
                named = (
                    name
                    if key in ("prev", "next")
                    else ends.get(key.removesuffix("_token"), key.removesuffix("_token"))
                )
                if (key.endswith("_token") or key in ("prev", "next")) and value:
                    assert value in tokens[named], (name, key)
                    checked += 1
    assert checked > 50
