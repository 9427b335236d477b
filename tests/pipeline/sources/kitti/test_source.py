"""KITTI in both layouts; and the real drive, with its labels' own 2D boxes as the judge of the calibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import iou_matrix
from pipeline.formats.kitti_records import parse_labels, parse_oxts, parse_timestamps
from pipeline.params import AlignmentParams
from pipeline.sources import SourceError, open_source
from pipeline.sources.kitti.hdl64_rings import ring_elevations_deg, rings_by_elevation
from tests.pipeline.sources.conftest import KITTI_BASELINE_M, KITTI_LABEL, T_ego_rect, object_calibration, rings_file


def test_object_layout(kitti: Path) -> None:
    source = open_source(f"kitti:{kitti}")
    assert (len(source), source.rate_hz) == (3, 10.0)
    assert [source.t_ns(i) for i in range(3)] == [0, 100_000_000, 200_000_000]
    assert any("10 Hz" in note for note in source.notes)
    assert any("of a VLP-16's 16 rings remain" in note for note in source.notes)
    frame = source.frame(2)
    assert frame.name == "0000000002"
    assert frame.ego is None
    assert frame.sweep is not None
    assert frame.sweep.points[0, 3] == pytest.approx(127.5), "intensity is 0–255"
    assert frame.image is not None
    assert frame.image.encoded is None
    assert source.truth(2) is None
    assert len(source.truth(1) or ()) == 1


def test_a_vlp16_like_sweep_keeps_matching_rings_once(kitti: Path) -> None:
    sweep = open_source(f"kitti:{kitti}").frame(0).sweep
    assert sweep is not None
    assert sweep.channels == 16
    assert np.unique(sweep.ring).tolist() == list(range(9)), "+2° is a ring of its own, 1° off both +1° and +3°"
    elevation = np.degrees(np.arctan2(sweep.points[:, 2], np.hypot(sweep.points[:, 0], sweep.points[:, 1])))
    assert np.max(np.abs(elevation - (-15 + 2.0 * sweep.ring))) <= 1.0
    assert np.bincount(sweep.ring).tolist() == [40] * 9


def test_all_64_rings(kitti: Path) -> None:
    sweep = open_source(f"kitti:{kitti}", rings=64).frame(0).sweep
    assert sweep is not None
    assert (sweep.channels, len(sweep.points)) == (64, 64 * 40)
    assert np.bincount(sweep.ring).tolist() == [40] * 64
    assert sweep.points[sweep.ring == 0, 2].max() < sweep.points[sweep.ring == 63, 2].min(), "0 is the lowest"


def test_camera_2_stands_beside_camera_0(kitti: Path) -> None:
    camera = open_source(f"kitti:{kitti}").frame(0).camera
    assert camera is not None
    alignment = resolve(AlignmentParams(), camera)
    assert alignment is not None
    pixel = alignment.project(np.array([[7.3, 0.0, -0.1]]))[0]  # 7 m ahead of camera 0, on its axis
    np.testing.assert_allclose(pixel, [60.0 + 700.0 * KITTI_BASELINE_M / 7.0, 20.0], atol=1e-6)


def test_raw_layout(kitti_raw: Path) -> None:
    source = open_source(f"kitti:{kitti_raw}")
    assert len(source) == 4
    assert np.diff([source.t_ns(i) for i in range(4)]).tolist() == [103_000_000] * 3
    assert source.t_ns(0) % 1_000_000_000 == 100_000_512
    assert not any("10 Hz" in note for note in source.notes)
    gap = source.frame(2)
    assert gap.sweep is None
    assert gap.notes == ("no LiDAR file for this frame",)
    assert gap.image is not None
    assert gap.image.t_ns - gap.t_ns == 3488, "the camera's own stamp"
    assert gap.ego is not None
    assert (gap.ego.speed_mps, gap.ego.yaw_rate_radps) == (15.5, 0.02)


def test_a_damaged_timestamps_file_is_named(kitti_raw: Path) -> None:
    """Its lines in reverse order: times run backwards, and an image is up to 0.3 s from its sweep."""
    assert not any("timestamps" in note for note in open_source(f"kitti:{kitti_raw}").notes)
    (file,) = kitti_raw.rglob("velodyne_points/timestamps.txt")
    file.write_text("".join(reversed(file.read_text().splitlines(keepends=True))))
    notes = open_source(f"kitti:{kitti_raw}").notes
    assert "the timestamps of images and sweeps differ by up to 0.3 s" in notes
    assert "timestamps run backwards in 3 of 4 frames" in notes


def test_oxts_says_where_the_velodyne_is(kitti_raw: Path) -> None:
    """The unit drives north; the Velodyne sits 0.81 m ahead of it and 0.32 m to its right, which is east."""
    source = open_source(f"kitti:{kitti_raw}")
    assert source.frame(0).gnss is None, "reckoned, not received"
    fix = source.frame(1).gnss
    assert fix is not None
    assert (fix.quality, fix.sigma_m, fix.course_rad, fix.speed_mps) == ("rtk_float", 0.04, 0.0, 14.5)
    assert (fix.lat_deg - 49.0) * 111_195 == pytest.approx(0.81, abs=0.01)
    assert (fix.lon_deg - 8.4) * 111_195 * np.cos(np.radians(49.0)) == pytest.approx(0.32, abs=0.01)
    assert fix.t_ns == source.t_ns(1)


def test_label_in_ego_axes() -> None:
    (car,) = parse_labels(KITTI_LABEL.encode(), np.linalg.inv(T_ego_rect()))
    # bottom centre 12 m ahead, 1 m left and 1.7 m below a camera 0.3 m ahead of and 0.1 m below the LiDAR
    np.testing.assert_allclose(car.cuboid.center, [12.3, 1.0, -1.8 + 0.75], atol=1e-6)
    assert car.cuboid.size == (4.0, 1.6, 1.5)
    assert car.cuboid.yaw_rad == pytest.approx(0.0, abs=1e-6)
    assert car.label == "car"


@pytest.mark.parametrize(
    ("rotation_y", "yaw_rad"), [(0.0, -np.pi / 2), (-np.pi / 2, 0.0), (-np.pi / 2 - 0.2, 0.2), (np.pi / 2, np.pi)]
)
def test_label_turn(rotation_y: float, yaw_rad: float) -> None:
    line = " ".join([*KITTI_LABEL.split()[:-1], str(rotation_y)])
    (car,) = parse_labels(line.encode(), np.linalg.inv(T_ego_rect()))
    assert np.angle(np.exp(1j * (car.cuboid.yaw_rad - yaw_rad))) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("line", ["Car 1 2 3", "Car " + "x " * 14, KITTI_LABEL.replace("4.00", "nan"), "hello"])
def test_a_broken_label_is_refused(line: str) -> None:
    with pytest.raises(SourceError):
        parse_labels(line.encode(), np.eye(4))


def test_timestamps_keep_nanoseconds_and_places() -> None:
    stamps = parse_timestamps(b"2011-09-26 13:04:32.349808512\nrubbish\n2011-09-26 13:04:33\n")
    assert stamps == (1317042272349808512, 0, 1317042273000000000)
    assert parse_timestamps(b"9999-12-31 23:59:59.9\n0001-01-01 00:00:00.0\n") == (0, 0), "beyond 64 bits"


def test_oxts_needs_all_fields() -> None:
    with pytest.raises(SourceError, match=r"x\.txt: not an oxts record"):
        parse_oxts(b"1 2 3", "x.txt")


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (b"", "no LiDAR points"),
        (b"garbage", "no LiDAR points"),
        (rings_file()[:-7], "truncated in the middle of a point"),
        (
            np.array([[10, 1, 9, 0.5]], dtype="<f4").tobytes(),
            "none of its rings matches the elevation of a VLP-16 ring",
        ),
        (rings_file(60), "60 rings instead of 64"),
        (rings_file(70), "not in KITTI's order; rings are assigned by elevation"),
        (np.array([[np.nan, 0, 0, 0.5]], dtype="<f4").tobytes() + rings_file(), "1 unreadable points skipped"),
    ],
)
def test_a_damaged_sweep_says_so(kitti: Path, content: bytes, note: str) -> None:
    (kitti / "velodyne/0000000002.bin").write_bytes(content)
    frame = open_source(f"kitti:{kitti}").frame(2)
    assert note in " ".join(frame.notes)
    assert frame.image is not None


@pytest.mark.parametrize("rings", [16, 64])
def test_a_few_points_out_of_order_cost_no_sweep(kitti: Path, rings: int) -> None:
    path = kitti / "velodyne/0000000002.bin"
    whole = open_source(f"kitti:{kitti}", rings=rings).frame(2).sweep
    stray = np.array([[20.0, -0.1, 0.7, 0.5], [20.0, 0.1, 0.7, 0.5]], dtype="<f4")
    path.write_bytes(path.read_bytes() + stray.tobytes())
    frame = open_source(f"kitti:{kitti}", rings=rings).frame(2)
    assert "assigned by elevation" in " ".join(frame.notes)
    assert whole is not None
    assert frame.sweep is not None
    np.testing.assert_array_equal(frame.sweep.ring[: len(whole.ring)], whole.ring)


def test_the_place_of_the_sensor_is_no_return(kitti: Path) -> None:
    path = kitti / "velodyne/0000000002.bin"
    whole = open_source(f"kitti:{kitti}").frame(2)
    path.write_bytes(path.read_bytes() + np.zeros((1, 4), dtype="<f4").tobytes())
    ended = open_source(f"kitti:{kitti}").frame(2)
    assert ended.notes == whole.notes
    assert ended.sweep is not None
    assert whole.sweep is not None
    np.testing.assert_array_equal(ended.sweep.points, whole.sweep.points)


def test_a_cut_image_says_so(kitti: Path) -> None:
    path = kitti / "image_02/0000000002.png"
    path.write_bytes(path.read_bytes()[:-20])
    frame = open_source(f"kitti:{kitti}").frame(2)
    assert frame.image is None
    assert frame.notes == ("0000000002.png: the image is truncated",)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "calibration 0000000001.txt: no P2 of 3×4 numbers"),
        (object_calibration().replace("R0_rect", "R9"), "no R0_rect"),
        (object_calibration().replace("-1.000000000e+00", "-2.000000000e+00"), "is not a rigid transform"),
        (object_calibration().replace("7.000000000e+02", "0.0"), "is not a camera matrix"),
    ],
)
def test_a_wrong_calibration_is_named(kitti: Path, text: str, says: str) -> None:
    (kitti / "calib/0000000001.txt").write_text(text)
    with pytest.raises(SourceError, match=says):
        open_source(f"kitti:{kitti}")


def test_an_inverted_velodyne_calibration_is_noticed(kitti_raw: Path) -> None:
    T = T_ego_rect()
    rotation, place = (" ".join(map(str, part.ravel())) for part in (T[:3, :3], T[:3, 3]))
    (kitti_raw.parent / "calib_velo_to_cam.txt").write_text(f"R: {rotation}\nT: {place}\n")
    with pytest.raises(SourceError, match="is its extrinsic inverted"):
        open_source(f"kitti:{kitti_raw}")


def test_a_missing_calibration_is_named(kitti: Path, kitti_raw: Path) -> None:
    (kitti / "calib/0000000001.txt").unlink()
    with pytest.raises(SourceError, match="no calibration"):
        open_source(f"kitti:{kitti}")
    (kitti_raw.parent / "calib_velo_to_cam.txt").unlink()
    with pytest.raises(SourceError, match=r"no calibration: calib_velo_to_cam\.txt must be in this folder or"):
        open_source(f"kitti:{kitti_raw}")


# ---------------------------------------------------------------- the real drive


def test_real_drive_has_ten_rings(data_dir: Path) -> None:
    source = open_source(f"kitti:{data_dir / 'kitti_0052'}")
    assert len(source) == 23
    assert source.notes[0].startswith("10 of a VLP-16's 16 rings remain")
    for index in (0, 11, 22):
        sweep = source.frame(index).sweep
        assert sweep is not None
        assert np.unique(sweep.ring).tolist() == list(range(10))


def test_a_drive_whose_sweeps_end_out_of_order_has_its_lidar(data_dir: Path) -> None:
    """Its sweeps end with a point at the sensor, which counts as the start of a 65th ring. The rings found by elevation
    are compared with the order of the file."""
    source = open_source(f"kitti:{data_dir / 'kitti_order'}", rings=64)
    assert len(source) == 3
    for index in range(len(source)):
        frame = source.frame(index)
        assert frame.sweep is not None
        assert not any("ring" in note for note in frame.notes)
        points, turn = frame.sweep.points, 63 - frame.sweep.ring.astype(np.int64)
        again = rings_by_elevation(points, ring_elevations_deg(points, turn, 64))
        far = np.hypot(points[:, 0], points[:, 1]) > 10.0
        assert np.mean(np.abs(again - turn)[far] <= 1) > 0.95  # the lasers sit up to 0.2 m apart, 1° at 10 m


def test_real_labels_land_on_their_2d_boxes(data_dir: Path) -> None:
    """Independent of our own transforms: each label line also contains the box that a person drew in the image."""
    folder = data_dir / "kitti_0052"
    source = open_source(f"kitti:{folder}")
    overlaps = []
    for index in (7, 14, 21):
        frame, truth = source.frame(index), source.truth(index)
        alignment = resolve(AlignmentParams(), frame.camera)
        assert truth is not None
        assert alignment is not None
        lines = (folder / "label_2" / f"{frame.name}.txt").read_text().splitlines()
        drawn = [line.split() for line in lines if not line.startswith("DontCare")]
        for words, item in zip(drawn, truth, strict=True):
            if float(words[1]) > 0.0:  # cut by the image's edge
                continue
            box = project_cuboid(alignment, item.cuboid.corners(), 1242, 375)
            assert box is not None
            overlaps.append(iou_matrix(np.array([box]), np.array([[float(word) for word in words[4:8]]]))[0, 0])
    assert len(overlaps) >= 15
    assert min(overlaps) > 0.7
    assert np.median(overlaps) > 0.85


def test_real_lead_holds_points(data_dir: Path) -> None:
    source = open_source(f"kitti:{data_dir / 'kitti_0052'}")
    sweep, truth = source.frame(7).sweep, source.truth(7)
    assert sweep is not None
    assert truth is not None
    lead = truth[0].cuboid
    near = np.abs(sweep.points[:, :3] - np.array(lead.center)) < np.array(lead.size) / 2
    assert np.count_nonzero(near.all(axis=1)) > 60
