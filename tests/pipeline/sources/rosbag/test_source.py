"""ROS bags as recordings."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import SourceError, open_source
from tests.pipeline.formats.velodyne.streams import PRODUCT, START_NS, ring_wall, with_byte
from tests.pipeline.sources.made.bags import (
    HEADER_NS,
    HEIGHT,
    POINT,
    RECORDED_LATER_NS,
    STEP_NS,
    WIDTH,
    BagWriter,
    Kind,
    write_bag,
    write_packet_bag,
)

KINDS: tuple[Kind, ...] = ("ros1", "db3", "mcap")


def path_of(folder: Path, kind: Kind) -> Path:
    return folder / ("drive.bag" if kind == "ros1" else "drive")


@pytest.mark.parametrize("kind", KINDS)
def test_every_sensor_of_a_bag(kind: Kind, tmp_path: Path) -> None:
    """The LiDAR is mounted turned to the left: an object on its right is ahead of the car."""
    told: list[tuple[int, int]] = []
    uri = f"rosbag:{write_bag(path_of(tmp_path, kind), kind)}"
    source = open_source(uri, progress=lambda done, total: told.append((done, total)))
    assert told == [(0, 12)], "every 64 messages; there are three of each sensor's"
    assert (len(source), source.rate_hz, source.title) == (3, 10.0, "drive")
    assert source.notes[0].startswith(
        "topics: lidar /velodyne_points (PointCloud2), camera /front/image_raw/compressed (CompressedImage), "
        "camera_info /front/camera_info (CameraInfo), gnss /fix (NavSatFix), odometry /odom (Odometry)"
    )
    for index in range(3):
        frame = source.frame(index)
        assert frame.t_ns == source.t_ns(index) == HEADER_NS + index * STEP_NS, "the header's time, not the recorder's"
        assert frame.notes == ()
        assert frame.sweep is not None
        wall = ring_wall(0, 10.0 - 0.1 * index)
        assert np.allclose(frame.sweep.points[:, 0], -wall.points[:, 1], atol=1e-4)
        assert np.allclose(frame.sweep.points[:, 1], wall.points[:, 0], atol=1e-4)
        assert np.array_equal(frame.sweep.ring, wall.ring)
        assert np.array_equal(frame.sweep.points[:, 3], wall.points[:, 3])
        assert frame.sweep.time_s is not None
        assert frame.sweep.time_s[0] == pytest.approx(-0.05)
        assert frame.image is not None
        assert frame.image.t_ns == frame.t_ns + 20_000_000
        assert frame.image.encoded is not None
        assert np.median(frame.image.bgr) == pytest.approx(60 + 40 * index, abs=2)
        assert frame.camera is not None
        ahead_below_camera = frame.camera.T_camera_ego @ [10.0, 0.0, 0.0, 1.0]
        assert np.allclose(ahead_below_camera[:3], [0.0, 0.3, 10.0], atol=1e-9)
        assert frame.ego is not None
        assert (frame.ego.speed_mps, frame.ego.yaw_rate_radps) == (12.0, 0.1)
        assert frame.gnss is not None
        assert (frame.gnss.quality, round(frame.gnss.sigma_m, 6)) == ("rtk_fixed", 0.02)
    assert frame.gnss.speed_mps == pytest.approx(12.0, rel=1e-3)
    assert frame.gnss.course_rad == pytest.approx(0.0)
    assert source.truth(0) is None


def test_frames_in_any_order_are_the_same(tmp_path: Path) -> None:
    source = open_source(f"rosbag:{write_bag(tmp_path / 'drive')}")
    forward = [source.frame(index).sweep for index in range(3)]
    for index in (2, 0, 1):
        assert source.frame(index).sweep.points.tobytes() == forward[index].points.tobytes()  # type: ignore[union-attr]
    with pytest.raises(IndexError):
        source.frame(3)


@pytest.mark.parametrize("kind", KINDS)
def test_packets_are_cut_anew(kind: Kind, tmp_path: Path) -> None:
    source = open_source(f"rosbag:{write_packet_bag(path_of(tmp_path, kind), kind)}")
    assert len(source) == 4
    assert any("split into sweeps behind the car" in note for note in source.notes)
    for index in range(4):
        frame = source.frame(index)
        assert frame.t_ns == pytest.approx(START_NS + index * STEP_NS, abs=2_000)
        assert frame.sweep is not None
        assert frame.sweep.t_ns == frame.t_ns
        assert len(frame.sweep.points) == 14_400
        assert np.median(np.linalg.norm(frame.sweep.points[:, :3], axis=1)) == pytest.approx(10 - index / 10, abs=0.01)


def test_the_line_runs_on_it(tmp_path: Path) -> None:
    source = open_source(f"rosbag:{write_bag(tmp_path / 'drive')}")
    results = [result for _, result in run(source, Params(), Detectors())]
    assert [result.ego is not None for result in results] == [True] * 3


def test_topics_can_be_chosen_and_left_out(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        for index in range(2):
            t_ns = HEADER_NS + index * STEP_NS
            for topic, range_m in (("/velodyne_points", 10.0), ("/rear/points", 5.0)):
                bag.write(topic, bag.cloud(ring_wall(t_ns, range_m), t_ns), t_ns)
            bag.write("/camera/image_raw", bag.jpeg(t_ns, 90), t_ns)
    assert distance_m(f"rosbag:{tmp_path / 'drive'}") == pytest.approx(10.0, abs=0.01)
    assert distance_m(f"rosbag:{tmp_path / 'drive'}?lidar=/rear/points") == pytest.approx(5.0, abs=0.01)
    alone = open_source(f"rosbag:{tmp_path / 'drive'}?lidar=none").frame(1)
    assert alone.sweep is None
    assert alone.image is not None
    assert alone.t_ns == HEADER_NS + STEP_NS
    assert open_source(f"rosbag:{tmp_path / 'drive'}?camera=none").frame(1).image is None


def distance_m(uri: str) -> float:
    sweep = open_source(uri).frame(0).sweep
    assert sweep is not None
    return float(np.median(np.linalg.norm(sweep.points[:, :3], axis=1)))


def test_a_message_without_a_time_is_taken_when_it_was_recorded(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        for index in range(2):
            cloud = bag.cloud(ring_wall(0), 0)
            bag.write("/points", cloud, HEADER_NS + index * STEP_NS + RECORDED_LATER_NS)
    source = open_source(f"rosbag:{tmp_path / 'drive'}")
    assert source.t_ns(1) == HEADER_NS + STEP_NS + RECORDED_LATER_NS
    assert "LiDAR: 2 messages without a timestamp: their recording time is used" in source.notes
    assert source.frame(1).sweep is not None


@pytest.mark.parametrize(
    ("encoding", "convert"),
    [("bgr8", None), ("rgb8", cv2.COLOR_BGR2RGB), ("bgra8", cv2.COLOR_BGR2BGRA), ("mono8", cv2.COLOR_BGR2GRAY)],
)
def test_raw_images(encoding: str, convert: int | None, tmp_path: Path) -> None:
    pixels = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    pixels[:, : WIDTH // 2] = (200, 100, 50) if encoding != "mono8" else (120, 120, 120)
    with BagWriter(tmp_path / "drive", "db3") as bag:
        sent = pixels if convert is None else cv2.cvtColor(pixels, convert)
        bag.write("/image_raw", bag.image(HEADER_NS, sent, encoding), HEADER_NS)
    image = open_source(f"rosbag:{tmp_path / 'drive'}").frame(0).image
    assert image is not None
    assert np.array_equal(image.bgr, pixels)


def test_clouds_without_rings_and_times(tmp_path: Path) -> None:
    plain = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
    with BagWriter(tmp_path / "drive", "db3") as bag:
        bag.write("/points", bag.cloud(ring_wall(0), HEADER_NS, plain), HEADER_NS)
    frame = open_source(f"rosbag:{tmp_path / 'drive'}").frame(0)
    assert frame.notes == ("no ring numbers: assigned by elevation, as on a VLP-16",)
    assert frame.sweep is not None
    assert frame.sweep.time_s is None
    assert np.array_equal(frame.sweep.ring, ring_wall(0).ring)


def test_rings_counted_from_above_are_turned_round(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        cloud = bag.cloud(ring_wall(0), HEADER_NS)
        rows = cloud.data.view(POINT)
        rows["ring"] = 15 - rows["ring"]
        bag.write("/points", cloud, HEADER_NS)
    sweep = open_source(f"rosbag:{tmp_path / 'drive'}").frame(0).sweep
    assert sweep is not None
    assert np.array_equal(sweep.ring, ring_wall(0).ring)


def test_a_camera_without_transform_is_not_fused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        bag.write("/points", bag.cloud(ring_wall(0), HEADER_NS), HEADER_NS)
        bag.write("/cam/image_raw", bag.jpeg(HEADER_NS, 90), HEADER_NS)
        bag.write("/cam/camera_info", bag.camera_info(HEADER_NS), HEADER_NS)
    source = open_source(f"rosbag:{tmp_path / 'drive'}")
    assert "no transform between velodyne and camera_optical: LiDAR and camera are not fused" in source.notes
    assert source.frame(0).camera is None


def test_a_transform_to_the_cameras_body_will_do(tmp_path: Path) -> None:
    """In many bags, the camera's frame is that of its body, with x forward."""
    with BagWriter(tmp_path / "drive", "db3") as bag:
        bag.write("/tf_static", bag.transforms(("velodyne", "camera_optical", (0, 0, 0.2), (0, 0, 0, 1.0))), HEADER_NS)
        bag.write("/points", bag.cloud(ring_wall(0), HEADER_NS), HEADER_NS)
        bag.write("/cam/image_raw", bag.jpeg(HEADER_NS, 90), HEADER_NS)
        bag.write("/cam/camera_info", bag.camera_info(HEADER_NS), HEADER_NS)
    camera = open_source(f"rosbag:{tmp_path / 'drive'}").frame(0).camera
    assert camera is not None
    assert np.allclose((camera.T_camera_ego @ [10.0, 0.0, 0.0, 1.0])[:3], [0.0, 0.2, 10.0])


WRONG = {
    "nothing": ("rosbag:", "no bag given"),
    "missing": ("rosbag:{0}/missing.bag", "no such file or folder"),
    "other folder": ("rosbag:{0}", "it has no metadata.yaml"),
    "other file": ("rosbag:{0}/notes.txt", "file names end in .bag"),
    "garbage": ("rosbag:{0}/garbage.bag", "garbage.bag: cannot be read as a bag"),
    "garbage db3": ("rosbag:{0}/garbage.db3", "garbage.db3: cannot be read as a bag"),
    "no such topic": ("rosbag:{0}/drive?lidar=/nope", "lidar=/nope: no such topic; there are /fix, /front/camera_info"),
    "wrong kind": ("rosbag:{0}/drive?lidar=/fix", "lidar=/fix: its messages are NavSatFix, not PointCloud2 or"),
    "no option": ("rosbag:{0}/drive?radar=/x", "unknown option 'radar'"),
    "nothing left": ("rosbag:{0}/drive?lidar=none&camera=none", "no LiDAR and no image topic; its topics are"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_in_one_sentence(name: str, tmp_path: Path) -> None:
    uri, says = WRONG[name]
    write_bag(tmp_path / "drive", sweeps=1)
    (tmp_path / "notes.txt").write_text("x")
    (tmp_path / "garbage.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(range(256)) * 20)
    (tmp_path / "garbage.db3").write_bytes(bytes(range(256)) * 20)
    with pytest.raises(SourceError) as error:
        open_source(uri.format(tmp_path))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_topic_whose_name_is_a_number_is_said(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "drive", sweeps=1)
    metadata = (bag / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(re.sub(r"name: ['\"]?/\S+", "name: 7", metadata))
    with pytest.raises(SourceError, match="cannot be read as a bag"):
        open_source(f"rosbag:{bag}")


def test_a_sensor_that_was_left_out_or_never_recorded_is_not_missed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        bag.write("/points", bag.cloud(ring_wall(0), HEADER_NS), HEADER_NS)
    assert open_source(f"rosbag:{tmp_path / 'drive'}").frame(0).notes == ()
    bag_path = write_bag(tmp_path / "both")
    metadata = (bag_path / "metadata.yaml").read_text(encoding="utf-8")
    (bag_path / "metadata.yaml").write_text(metadata.replace("CompressedImage", "Compres:edImage"), encoding="utf-8")
    assert open_source(f"rosbag:{bag_path}?camera=none").frame(0).notes == ()


def test_another_velodyne_is_named(tmp_path: Path) -> None:
    from tests.pipeline.formats.velodyne.streams import drive

    with BagWriter(tmp_path / "drive", "db3") as bag:
        bag.write("/velodyne_packets", bag.scan([(with_byte(p, PRODUCT, 0xA1), t) for p, t in drive(1)]), HEADER_NS)
    with pytest.raises(SourceError, match=r"packets of a Velodyne VLS-128 \(Alpha Prime\); only VLP-16"):
        open_source(f"rosbag:{tmp_path / 'drive'}")


@pytest.mark.parametrize("what", ["cut off", "empty", "NaN"])
def test_a_bad_cloud_degrades_its_frame(what: str, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "drive", "db3") as bag:
        for index in range(3):
            t_ns = HEADER_NS + index * STEP_NS
            cloud = bag.cloud(ring_wall(0), t_ns)
            if index == 1 and what == "cut off":
                cloud.data = cloud.data[:-40]
            elif index == 1 and what == "empty":
                cloud.width, cloud.row_step, cloud.data = 0, 0, cloud.data[:0]
            elif index == 1:
                cloud.data.view(POINT)["x"] = np.nan
            bag.write("/points", cloud, t_ns)
    source = open_source(f"rosbag:{tmp_path / 'drive'}")
    assert [source.frame(index).sweep is not None for index in range(3)] == [True, False, True]
    assert source.frame(1).notes[0].startswith("LiDAR: ")


def test_nebula(data_dir: Path) -> None:
    """A bag without message definitions, from a driver that cuts sweeps straight ahead."""
    name = "nebula_1673400471837873222_1673400471837873222_0.db3"
    source = open_source(f"rosbag:{data_dir / 'vlp16_packets' / name}")
    assert len(source) == 3
    for index in range(3):
        frame = source.frame(index)
        assert frame.sweep is not None
        assert 14_700 < len(frame.sweep.points) < 15_000
        assert frame.notes == ()


@pytest.mark.parametrize("kind", KINDS)
def test_frames_from_several_threads(kind: Kind, tmp_path: Path) -> None:
    source = open_source(f"rosbag:{write_bag(path_of(tmp_path, kind), kind)}")
    with ThreadPoolExecutor(4) as pool:
        frames = list(pool.map(source.frame, [0, 1, 2] * 4))
    assert [frame.index for frame in frames] == [0, 1, 2] * 4
    assert all(frame.sweep is not None and frame.image is not None for frame in frames)


@pytest.mark.timeout(60)
def test_a_huge_description_is_refused_without_reading_it(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", "db3", sweeps=1, every=50)
    with open(bag / "metadata.yaml", "r+b") as file:
        file.truncate(5 << 20)
    with pytest.raises(SourceError, match=r"metadata\.yaml is larger than 4 MiB"):
        open_source(f"rosbag:{bag}")
