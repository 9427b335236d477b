"""Astyx folders: frames, transforms, damage; and the real recording, looked at through its own labels."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.common.geometry import inverse, rotation, transform
from pipeline.params import AlignmentParams
from pipeline.sources import SourceError, open_source
from pipeline.types.source import Source
from tests.pipeline.sources.conftest import LIDAR_ROWS, astyx_calibration


def opened(folder: Path) -> Source:
    return open_source(f"astyx:{folder}")


def change_calibration(folder: Path, change: object) -> None:
    calibration = astyx_calibration()
    change(calibration["sensors"])  # type: ignore[operator]
    for path in (folder / "calibration").iterdir():
        path.write_text(json.dumps(calibration))


def test_a_frame_holds_both_sensors_in_the_ego_frame(astyx: Path) -> None:
    source = opened(astyx)
    frame = source.frame(1)
    assert frame.name == "000002"
    assert frame.notes == ()
    assert frame.sweep is not None
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(0.0, 0.0, 0.1), (0.5, -0.2, 0.3)
    raw = np.array([[float(word) for word in row.split()] for row in LIDAR_ROWS])
    np.testing.assert_allclose(frame.sweep.points[:, :3], transform(T, raw[:, :3]), atol=1e-5)
    assert frame.sweep.points[:, 3].tolist() == [7.0, 8.0, 90.0, 33.0]
    assert frame.sweep.ring.tolist() == [0, 8, 1, 15], "laser 0 is −15°, 1 is +1°, 2 is −13°, 15 is +15°"
    assert frame.sweep.points.dtype == np.float32
    assert frame.sweep.points.flags.c_contiguous
    assert frame.image is not None
    assert frame.image.encoded == (astyx / "camera_front" / "000002.jpg").read_bytes()
    assert frame.ego is None


def test_camera_extrinsic_is_turned_round(astyx: Path) -> None:
    camera = opened(astyx).frame(0).camera
    assert camera is not None
    assert (camera.width, camera.height) == (160, 60)
    alignment = resolve(AlignmentParams(), camera)
    assert alignment is not None
    ahead = alignment.project(np.array([[9.0, 0.1, 1.2], [9.0, 1.1, 1.2], [9.0, 0.1, 2.2]]))
    np.testing.assert_allclose(ahead, [[80.0, 30.0], [70.0, 30.0], [80.0, 20.0]], atol=1e-6)


def test_time_is_the_middle_of_the_sweep(astyx: Path) -> None:
    source = opened(astyx)
    assert [source.t_ns(i) for i in range(2)] == [1_050_000_000, 1_350_000_000]
    assert source.frame(1).t_ns == source.t_ns(1)
    assert source.rate_hz == pytest.approx(10 / 3, abs=0.01)


def test_labels_become_cuboids(astyx: Path) -> None:
    truth = opened(astyx).truth(0)
    assert truth is not None
    (car,) = truth
    assert (car.label, car.id) == ("car", None)
    assert car.cuboid.center == (20.0, 1.0, 0.5)
    assert car.cuboid.size == (4.2, 1.8, 1.5)
    assert car.cuboid.yaw_rad == pytest.approx(0.3)


def test_an_index_outside_is_refused(astyx: Path) -> None:
    source = opened(astyx)
    for index in (-1, 2):
        with pytest.raises(IndexError):
            source.frame(index)


@pytest.mark.parametrize(
    ("damage", "note"),
    [
        (lambda folder: (folder / "lidar_vlp16/000002.txt").unlink(), "no LiDAR file for this frame"),
        (lambda folder: (folder / "lidar_vlp16/000002.txt").write_bytes(b""), "000002.txt: no LiDAR points"),
        (lambda folder: (folder / "lidar_vlp16/000002.txt").write_bytes(bytes(range(256)) * 9), "no LiDAR points"),
        (lambda folder: (folder / "camera_front/000002.jpg").unlink(), "no image for this frame"),
        (lambda folder: (folder / "camera_front/000002.jpg").write_bytes(b""), "000002.jpg: not a readable image"),
        (lambda folder: (folder / "camera_front/000002.jpg").write_bytes(b"\xff\xd8\xff\xe0x"), "image is truncated"),
        (lambda folder: (folder / "calibration/000002.json").write_text("{"), "first calibration is used"),
    ],
)
def test_a_damaged_frame_says_so_and_keeps_the_rest(astyx: Path, damage: object, note: str) -> None:
    damage(astyx)  # type: ignore[operator]
    source = opened(astyx)
    assert len(source) == 2
    frame = source.frame(1)
    assert note in " ".join(frame.notes)
    assert frame.sweep is not None or frame.image is not None
    assert frame.camera is not None
    assert source.frame(0).notes == ()
    assert source.t_ns(1) > source.t_ns(0)


def test_bad_rows_are_left_out_and_counted(astyx: Path) -> None:
    rows = ["nan 0 0 1 0 5", "inf 0 0 1 0 5", "1 2 3 4 16 5", "1 2 3 4 0.5 5", "0 0 0 9 3 5", "1 2 3 4"]
    text = "\n".join(["X Y Z Reflectivity LaserID Timestamp", *LIDAR_ROWS, *rows])
    (astyx / "lidar_vlp16/000001.txt").write_text(text)
    frame = opened(astyx).frame(0)
    assert frame.sweep is not None
    assert len(frame.sweep.points) == len(LIDAR_ROWS)
    assert frame.notes == ("000001.txt: 6 unreadable rows skipped",)


def test_an_image_of_another_size_is_left_out(astyx: Path) -> None:
    other = (astyx / "camera_front/000001.jpg").read_bytes()
    cv2.imwrite(str(astyx / "camera_front/000002.jpg"), np.zeros((30, 30, 3), dtype=np.uint8))
    frame = opened(astyx).frame(1)
    assert frame.image is None
    assert "30×30, the others are 160×60" in frame.notes[0]
    assert opened(astyx).frame(0).image.encoded == other  # type: ignore[union-attr]


def _scale_rotation(sensors: list[dict]) -> None:
    sensors[1]["calib_data"]["T_to_ref_COS"][0][0] = 2.0


def _mirror(sensors: list[dict]) -> None:
    T = np.array(sensors[1]["calib_data"]["T_to_ref_COS"])
    T[:, 1] *= -1.0
    sensors[1]["calib_data"]["T_to_ref_COS"] = T.tolist()


def _invert_camera(sensors: list[dict]) -> None:
    data = sensors[2]["calib_data"]
    data["T_to_ref_COS"] = inverse(np.array(data["T_to_ref_COS"])).tolist()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_scale_rotation, "calibration 000001.json: T_to_ref_COS of lidar_vlp16 is not a rigid transform"),
        (_mirror, "is not a rigid transform"),
        (_invert_camera, "does not look ahead; is its extrinsic inverted"),
        (lambda sensors: sensors.pop(), "not an Astyx calibration"),
        (
            lambda sensors: sensors[2]["calib_data"].update(K=[[1, 2], [3, 4]]),
            "K of camera_front is not a camera matrix",
        ),
        (lambda sensors: sensors[2]["calib_data"]["K"][0].__setitem__(0, 0.0), "is not a camera matrix"),
        (lambda sensors: sensors[1]["calib_data"].update(T_to_ref_COS=[[10**400]]), "is not a rigid transform"),
    ],
)
def test_a_wrong_calibration_is_named(astyx: Path, change: object, says: str) -> None:
    change_calibration(astyx, change)
    with pytest.raises(SourceError, match=says):
        opened(astyx)


def test_a_missing_calibration_is_named(astyx: Path) -> None:
    for path in (astyx / "calibration").iterdir():
        path.unlink()
    with pytest.raises(SourceError, match=r"no calibration/\*\.json"):
        opened(astyx)


# ---------------------------------------------------------------- the real recording


def test_real_rings_lie_on_the_vlp16s_elevations(data_dir: Path) -> None:
    source = opened(data_dir / "astyx")
    assert len(source) == 39
    sweep = source.frame(27).sweep
    assert sweep is not None
    assert len(sweep.points) == 21089
    calibration = json.loads((data_dir / "astyx/calibration/000414.json").read_bytes())
    T = np.array(calibration["sensors"][1]["calib_data"]["T_to_ref_COS"])
    x, y, z = transform(inverse(T), sweep.points[:, :3]).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    far = np.hypot(x, y) > 5.0  # files give centimetres
    for ring in range(16):
        assert np.median(elevation[far & (sweep.ring == ring)]) == pytest.approx(-15 + 2 * ring, abs=0.1)


def test_real_labels_hold_the_points_of_their_cars(data_dir: Path) -> None:
    """Labels, quaternion order, ego frame and sweep agree: cuboids of near cars contain points, and the space beside
    them does not."""
    source = opened(data_dir / "astyx")
    inside, beside = [], []
    for index in range(0, len(source), 3):
        sweep, truth = source.sweep(index), source.truth(index)
        assert sweep is not None
        assert truth is not None
        for item in truth:
            x, y, _ = item.cuboid.center
            if not 5.0 < x < 30.0 or abs(y) > 8.0:
                continue
            away = sweep.points[:, :2] - np.array([x, y])
            c, s = np.cos(item.cuboid.yaw_rad), np.sin(item.cuboid.yaw_rad)
            along, across = away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s
            # well above the road: the recording's frame is pitched against it
            height = np.abs(sweep.points[:, 2] - item.cuboid.center[2]) < item.cuboid.size[2] * 0.3
            held = height & (np.abs(along) < item.cuboid.size[0] / 2 + 0.2)
            inside.append(np.count_nonzero(held & (np.abs(across) < item.cuboid.size[1] / 2 + 0.2)))
            margin = np.abs(across) - item.cuboid.size[1] / 2
            beside.append(np.count_nonzero(held & (margin > 0.3) & (margin < 0.9)))
    assert len(inside) > 10
    assert np.mean(np.array(inside) >= 5) > 0.8
    assert np.sum(beside) < 0.25 * np.sum(inside)


def test_real_distances_shrink_in_the_closing_run(data_dir: Path) -> None:
    source = opened(data_dir / "astyx")
    nearest = []
    for index, frame in enumerate(source.outlines()):
        truth = source.truth(index) or ()
        ahead = [item.cuboid.center[0] for item in truth if abs(item.cuboid.center[1]) < 1.5 and item.label == "car"]
        if frame.name >= "000414" and ahead:
            nearest.append(min(ahead))
    assert nearest[0] == pytest.approx(34.2, abs=0.1)
    assert nearest[-1] < 27.0
