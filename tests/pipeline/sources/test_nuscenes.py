"""nuScenes, built from its published schema (``nuscenes_on_disk``): no file of the data set may be passed on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.geometry import transform
from pipeline.sources import SourceError, open_source
from pipeline.types.source import lidar_frame
from tests.pipeline.sources.made.nuscenes_on_disk import (
    BOX_AT,
    BOX_SIZE,
    LIDAR_AT,
    SPEED_MPS,
    START_US,
    YAW_RATE_RADPS,
    write_nuscenes,
)


@pytest.fixture
def mini(tmp_path: Path) -> Path:
    return write_nuscenes(tmp_path / "nuscenes", scenes=2)


def test_a_bare_folder_opens_its_first_scene_and_names_the_others(mini: Path) -> None:
    source = open_source(str(mini))
    assert (source.title, len(source), source.rate_hz) == ("scene-0061", 12, 20.0)
    assert source.notes == ("2 scenes; ?scene= opens another: scene-0103",)
    assert open_source(f"{mini}?scene=scene-0103").title == "scene-0103"
    assert open_source(f"nuscenes:{mini}?version=v1.0-mini").title == "scene-0061"


def test_points_are_in_the_axes_of_the_car_at_the_lidar(mini: Path) -> None:
    frame = open_source(str(mini)).frame(0)
    assert frame.sweep is not None
    points = frame.sweep.points
    assert points[:, 0] == pytest.approx(12.0, abs=1e-4), "the wall is ahead"
    assert points[points[:, 3] > 100.0, 1].min() > 0.0, "its bright half is left"
    assert (frame.sweep.channels, frame.sweep.ring.max()) == (32, 31)
    assert points[frame.sweep.ring == 31, 2] == pytest.approx(1.5, abs=1e-4)


def test_points_fall_into_the_image_where_the_camera_sees_them(mini: Path) -> None:
    frame = open_source(str(mini)).frame(1)
    assert frame.sweep is not None
    assert frame.camera is not None
    assert frame.image is not None
    assert frame.image.bgr.shape == (90, 160, 3)
    assert frame.camera.road_z_m == -LIDAR_AT[2]
    in_camera = transform(frame.camera.T_camera_ego, frame.sweep.points[:, :3])
    assert in_camera[:, 2] == pytest.approx(12.0 + 0.94 - 1.7, abs=1e-4)
    bright = frame.sweep.points[:, 3] > 100.0
    assert (frame.camera.K @ in_camera[bright].T)[0].max() < 80.0 * in_camera[0, 2], "left of the middle"
    level = frame.sweep.points[frame.sweep.ring == 16, 2][0]
    assert in_camera[frame.sweep.ring == 16, 1] == pytest.approx(-(level + 1.84 - 1.5), abs=1e-4)


def test_calibrations_of_other_tools_relate_to_the_lidar_of_the_files(mini: Path) -> None:
    """nuScenes' LIDAR_TOP has x to the right; the ego frame has the car's axes."""
    source = open_source(f"nuscenes:{mini}")
    mount = lidar_frame(source)
    assert mount is not None
    sweep = source.frame(0).sweep
    assert sweep is not None
    file = min((mini / "samples" / "LIDAR_TOP").iterdir())
    own = np.fromfile(file, np.float32).reshape(-1, 5)[:, :3]
    turned = own @ mount[:3, :3].T
    nearest = [np.abs(sweep.points[:, :3] - each).max(axis=1).min() for each in turned[::40]]
    assert max(nearest) < 1e-3


def test_times_and_own_motion_are_those_of_the_tables(mini: Path) -> None:
    source = open_source(str(mini))
    frame = source.frame(5)
    assert frame.t_ns == (START_US + 250_000) * 1000
    assert frame.name == str(START_US + 250_000)
    assert frame.image is not None
    assert frame.image.t_ns == frame.t_ns + 15_000_000, "the next image is nearer than its own, 35 ms before"
    assert frame.ego is not None
    assert frame.ego.source == "ins"
    assert frame.ego.speed_mps == pytest.approx(SPEED_MPS, abs=0.03)
    assert frame.ego.yaw_rate_radps == pytest.approx(YAW_RATE_RADPS, abs=1e-3)


def test_key_frames_are_labelled_and_others_are_not(mini: Path) -> None:
    source = open_source(str(mini))
    (car,) = source.truth(0) or ()
    assert (car.label, car.called, car.id) == ("car", "vehicle.car", 0)
    assert np.array(car.cuboid.center) == pytest.approx(np.array(BOX_AT) - LIDAR_AT)
    assert car.cuboid.size == (BOX_SIZE[1], BOX_SIZE[0], BOX_SIZE[2])
    assert car.cuboid.yaw_rad == pytest.approx(0.0, abs=1e-6)
    (later,) = source.truth(10) or ()
    assert later.cuboid.center[0] == pytest.approx(BOX_AT[0] - LIDAR_AT[0] - 5.0, abs=0.6), "5 m nearer after 0.5 s"
    assert later.cuboid.yaw_rad == pytest.approx(-0.1)
    assert source.truth(1) is None


def test_key_frames_alone_are_a_recording_at_2_hz(mini: Path) -> None:
    for file in (mini / "sweeps").glob("*/*"):
        file.unlink()
    source = open_source(str(mini))
    assert (len(source), source.rate_hz) == (2, 2.0)
    ego = source.frame(1).ego
    assert ego is not None
    assert ego.speed_mps == pytest.approx(SPEED_MPS, abs=0.1)


TABLES = "v1.0-mini"
WRONG: dict[str, tuple[str, str, str]] = {
    "table cut": ("sample_data", "cut", r"v1\.0-mini/sample_data\.json: not a table of nuScenes, or cut off"),
    "table missing": ("ego_pose", "gone", r"v1\.0-mini/ego_pose\.json is missing"),
    "rows missing": ("ego_pose", "[]", r"v1\.0-mini/ego_pose\.json: 12 poses are missing"),
    "another table": ("scene", '[{"a": 1}]', r"v1\.0-mini/scene\.json: not a table of nuScenes"),
    "no scenes": ("scene", "[]", r"v1\.0-mini/scene\.json: no scenes in it"),
    "no sensors": ("sensor", "[]", "scene-0061 has no LIDAR_TOP files; samples/ or sweeps/ is missing"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_damaged_table_is_named_in_one_line(what: str, mini: Path) -> None:
    name, change, says = WRONG[what]
    table = mini / TABLES / f"{name}.json"
    if change == "gone":
        table.unlink()
    else:
        table.write_text(table.read_text()[:-400] if change == "cut" else change)
    with pytest.raises(SourceError, match=says):
        open_source(str(mini))


def test_what_is_missing_of_the_folder_is_said(mini: Path) -> None:
    with pytest.raises(SourceError, match=r"scene=scene-0001: no such scene; there are scene-0061, scene-0103"):
        open_source(f"{mini}?scene=scene-0001")
    with pytest.raises(SourceError, match=r"no tables of nuScenes: v1\.0-test/sample_data\.json is missing"):
        open_source(f"{mini}?version=v1.0-test")


def test_a_damaged_sweep_and_image_leave_their_branch_empty(mini: Path) -> None:
    sweep = sorted((mini / "sweeps" / "LIDAR_TOP").iterdir())[0]
    image = sorted((mini / "sweeps" / "CAM_FRONT").iterdir())[1]
    sweep.write_bytes(sweep.read_bytes()[:30])
    image.write_bytes(image.read_bytes()[:100])
    frame = open_source(str(mini)).frame(1)
    assert frame.sweep is not None
    assert len(frame.sweep.points) == 1
    assert frame.image is None
    assert frame.notes == (
        f"{sweep.name}: truncated in the middle of a point",
        f"{image.name}: the image is truncated",
    )


@pytest.mark.parametrize("elsewhere", ["{outside}", "../secret.bin", "samples/../../secret.bin", "a\0b"])
def test_a_table_names_no_files_elsewhere(elsewhere: str, mini: Path) -> None:
    outside = mini.parent / "secret.bin"
    outside.write_bytes((mini / "samples" / "LIDAR_TOP" / f"n015__LIDAR_TOP__{START_US}.pcd.bin").read_bytes())
    table = mini / TABLES / "sample_data.json"
    rows = json.loads(table.read_text())
    for row in rows:
        row["filename"] = elsewhere.format(outside=outside) if "LIDAR" in row["filename"] else row["filename"]
    table.write_text(json.dumps(rows))
    with pytest.raises(SourceError, match="has no LIDAR_TOP files"):
        open_source(str(mini))


def test_sweeps_of_one_time_are_a_recording_without_own_motion(mini: Path) -> None:
    table = mini / TABLES / "sample_data.json"
    rows = json.loads(table.read_text())
    table.write_text(json.dumps([row | {"timestamp": START_US} for row in rows]))
    source = open_source(str(mini))
    assert (len(source), source.frame(1).ego) == (12, None)


def test_a_file_of_an_impossible_time_is_left_out(mini: Path) -> None:
    table = mini / TABLES / "sample_data.json"
    table.write_text(table.read_text().replace(f'"timestamp": {START_US},', f'"timestamp": {START_US}0000000,'))
    assert len(open_source(str(mini))) == 11


def test_a_pose_that_is_none_is_said(mini: Path) -> None:
    table = mini / TABLES / "calibrated_sensor.json"
    rows = json.loads(table.read_text())
    rows[0]["rotation"] = [0.0, 0.0, 0.0, 0.0]
    table.write_text(json.dumps(rows))
    with pytest.raises(SourceError, match=r"calibrated_sensor\.json: its rotation is not a unit quaternion"):
        open_source(str(mini))


def test_without_a_calibrated_camera_every_frame_says_why_it_has_no_image(mini: Path) -> None:
    table = mini / "v1.0-mini" / "calibrated_sensor.json"
    rows = [row for row in json.loads(table.read_text()) if not row["camera_intrinsic"]]
    table.write_text(json.dumps(rows))
    source = open_source(str(mini))
    frame = source.frame(0)
    assert frame.sweep is not None
    assert frame.image is None
    (note,) = frame.notes
    assert note.startswith("no images: no CAM_FRONT files")
    assert note in source.notes
