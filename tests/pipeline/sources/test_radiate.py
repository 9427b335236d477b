"""RADIATE, built from the format of its SDK, whose sample was looked at: sweeps of 23,000 rows such as
``27.335,14.601,0,8,23``, an index whose frames begin at 18 where files begin at 1, velocities in north, east, down."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.common.geometry import transform
from pipeline.sources import SourceError, open_source
from pipeline.sources.radiate import parse_state
from pipeline.types.source import lidar_frame

START_NS = 1_574_859_771_700_975_000
COUNT = 6
NORTH_MPS, EAST_MPS, DOWN_RADPS = -7.33568, -10.13310, 0.03532
"""Turn rate in a right bend, as in the sample: the course increases while it is positive."""


def wall() -> str:
    """A wall 12 m ahead with a bright left half, as seen by 32 rings; y points ahead, x to the right."""
    rows = [
        f"{-left:.5g},12,{(ring - 23) * 0.2:.5g},{200 if left > 0 else 20},{ring}"
        for ring in range(32)
        for left in np.linspace(-5.0, 5.0, 20)
    ]
    return "\n".join(rows) + "\n"


def state(north: float = NORTH_MPS, east: float = EAST_MPS, down: float = DOWN_RADPS) -> str:
    zero = "0.000,0.000,0.000 \n"
    covariance = "0.027,0.000,0.000 \n 0.000,0.040,0.000 \n 0.000,0.000,0.147 \n"
    body = "-0.00401,0.00605,-0.98617,-0.16556 \n0.00151,-0.00572,0.03532 \n-0.58829,0.53698,0.04222 \n"
    return (
        f"55.892356217787842,-3.321681825764582,209.304443359375 \n{covariance}{body}{zero * 9}"
        f"{north},{east},-0.32492 \n0.00151,-0.00572,{down} \n"
    )


def write_radiate(folder: Path, first: int = 1, indexed_from: int = 1, frames: int = COUNT) -> Path:
    """Sweeps at 10 Hz, images 20 ms after each, states 10 ms before. first: number of the first files; indexed_from:
    number of the first frame in the indices."""
    for name, suffix, late_ns in (
        ("velo_lidar", "csv", 0),
        ("zed_left", "png", 20_000_000),
        ("GPS_IMU_Twist", "txt", -10_000_000),
    ):
        (folder / name).mkdir(parents=True)
        lines = []
        for k in range(frames):
            path, t_ns = folder / name / f"{first + k:06d}.{suffix}", START_NS + k * 100_000_000 + late_ns
            if suffix == "png":
                cv2.imwrite(str(path), np.full((376, 672, 3), 10 * k, np.uint8))
            else:
                path.write_text(wall() if suffix == "csv" else state())
            lines.append(f"Frame: {indexed_from + k:06d} Time: {t_ns // 10**9}.{t_ns % 10**9:09d}\n")
        (folder / f"{name}.txt").write_text("".join(lines))
    return folder


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    return write_radiate(tmp_path / "fog_6_0")


def test_a_sequence_opens_by_its_bare_path_at_its_own_times(sequence: Path) -> None:
    source = open_source(str(sequence))
    assert (source.title, len(source), source.rate_hz) == ("fog_6_0", COUNT, 10.0)
    frame = source.frame(2)
    assert (frame.t_ns, frame.name) == (START_NS + 200_000_000, "000003")
    assert frame.image is not None
    assert frame.image.t_ns == frame.t_ns + 20_000_000
    assert frame.image.bgr[0, 0, 0] == 20


def test_files_that_are_counted_anew_take_the_lines_of_the_index(tmp_path: Path) -> None:
    source = open_source(str(write_radiate(tmp_path / "tiny_foggy", indexed_from=3)))
    assert source.t_ns(0) == START_NS
    assert len(source) == COUNT


def test_points_are_in_the_axes_of_the_car(sequence: Path) -> None:
    sweep = open_source(str(sequence)).frame(0).sweep
    assert sweep is not None
    assert sweep.points[:, 0] == pytest.approx(12.0)
    assert sweep.points[sweep.points[:, 3] > 100.0, 1].min() > 0.0, "the bright half is left"
    assert (sweep.channels, len(sweep.points)) == (32, 640)
    assert sweep.points[sweep.ring == 23, 2] == pytest.approx(0.0)


def test_calibrations_of_other_tools_relate_to_the_lidar_of_the_files(sequence: Path) -> None:
    mount = lidar_frame(open_source(f"radiate:{sequence}"))
    assert mount is not None
    np.testing.assert_allclose(mount[:3, :3] @ [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], err_msg="its y axis points ahead")


def test_points_fall_into_the_image_where_the_sdk_draws_them(sequence: Path) -> None:
    """Computed by hand from ``default-calib.yaml``: a point ahead at the LiDAR's height is 5 cm above the camera and 26
    cm to its right, and the camera is turned 1.28° down and 0.53° to the side."""
    camera = open_source(str(sequence)).frame(0).camera
    assert camera is not None
    x, y, z = transform(camera.T_camera_ego, np.array([[20.0, 0.0, 0.0]]))[0]
    assert z == pytest.approx(20.0, abs=0.05)
    assert (x, y) == (pytest.approx(0.26, abs=0.25), pytest.approx(-0.05, abs=0.5))
    left, _, _ = transform(camera.T_camera_ego, np.array([[20.0, 5.0, 0.0]]))[0]
    assert left == pytest.approx(x - 5.0, abs=0.01)
    _, up, _ = transform(camera.T_camera_ego, np.array([[20.0, 0.0, 1.0]]))[0]
    assert up == pytest.approx(y - 1.0, abs=0.01)
    assert camera.distortion.tolist() == [-0.183879883467351, 0.0308609205858947, 0.0, 0.0]


def test_own_motion_and_place_are_those_of_the_inertial_unit(sequence: Path) -> None:
    frame = open_source(str(sequence)).frame(1)
    assert frame.ego is not None
    assert frame.gnss is not None
    assert frame.ego.speed_mps == pytest.approx(12.51, abs=0.01)
    assert frame.ego.yaw_rate_radps == pytest.approx(-0.03532), "to the right"
    assert frame.ego.source == "ins"
    assert frame.ego.t_ns == frame.t_ns - 10_000_000
    assert np.degrees(frame.gnss.course_rad or 0.0) == pytest.approx(234.1, abs=0.1), "south-west, as its places move"
    assert (frame.gnss.lat_deg, frame.gnss.sigma_m) == (pytest.approx(55.8923562), pytest.approx(0.2))


def test_a_rig_file_gives_another_calibration(sequence: Path) -> None:
    assert "default-calib.yaml" in open_source(str(sequence)).notes[0]
    text = "camera: {calibration: {fx_px: 400, fy_px: 400, cx_px: 336, cy_px: 188, width_px: 672, height_px: 376}}"
    (sequence / "rig.yaml").write_text(text)
    source = open_source(str(sequence))
    camera = source.frame(0).camera
    assert camera is not None
    assert camera.K[0, 0] == 400.0
    assert source.notes == ()
    with pytest.raises(SourceError, match=r"rig=other\.yaml: no such file"):
        open_source(f"{sequence}?rig=other.yaml")


@pytest.mark.parametrize("missing", ["zed_left.txt", "GPS_IMU_Twist.txt"])
def test_what_has_no_times_is_left_out_and_said(missing: str, sequence: Path) -> None:
    (sequence / missing).unlink()
    source = open_source(str(sequence))
    frame = source.frame(0)
    if missing == "zed_left.txt":
        assert frame.image is None
        said = "no images: no zed_left/*.png whose time is in zed_left.txt"
        assert said in source.notes
        assert said in frame.notes
    else:
        assert frame.ego is None
        assert "no ego speed recorded" in source.notes


def test_sweeps_without_times_are_refused_in_one_line(sequence: Path) -> None:
    (sequence / "velo_lidar.txt").write_text("Frame: 000001 Ti")
    with pytest.raises(SourceError, match=r"no velo_lidar/\*\.csv whose time is in velo_lidar\.txt"):
        open_source(str(sequence))


def test_a_cut_file_leaves_its_branch_empty_and_says_so(sequence: Path) -> None:
    (sequence / "velo_lidar" / "000001.csv").write_text("1,2")
    (sequence / "GPS_IMU_Twist" / "000001.txt").write_text(state()[:200])
    frame = open_source(str(sequence)).frame(0)
    assert (frame.sweep, frame.ego) == (None, None)
    assert frame.notes == ("000001.csv: no LiDAR points", "000001.txt: not a record of the GNSS/INS")
    (sequence / "velo_lidar" / "000002.csv").write_text(wall() + "1,2,3,999,4\nx,y\n")
    assert open_source(str(sequence)).frame(1).notes == ("000002.csv: 2 unreadable rows skipped",)


def test_times_beyond_64_bits_are_left_out(sequence: Path) -> None:
    file = sequence / "velo_lidar.txt"
    whole = len(open_source(str(sequence)))
    file.write_text(re.sub(r"Time: \d+", "Time: 9999999999", file.read_text(), count=1))
    assert len(open_source(str(sequence))) == whole - 1


def test_a_negative_variance_is_damage() -> None:
    damaged = re.sub(r"-?\d+\.?\d*(e[-+]?\d+)?", "-1", state())
    with pytest.raises(SourceError, match="a: not a record of the GNSS/INS"):
        parse_state(damaged.encode(), "a", 5)


def test_a_standing_car_has_no_course() -> None:
    ego, fix = parse_state(state(0.1, 0.1, 0.0).encode(), "a", 5)
    assert (ego.speed_mps, fix.course_rad) == (pytest.approx(0.1414, abs=1e-3), None)
