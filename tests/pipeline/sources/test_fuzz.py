"""Every file of a recording, damaged at random: a sentence or a degraded frame, never another exception."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.sources import SourceError, open_source
from tests.pipeline.sources.conftest import write_astyx, write_kitti, write_kitti_raw
from tests.pipeline.sources.kitti.test_kitti360 import DRIVE, write_kitti360
from tests.pipeline.sources.made.bags import Kind, write_bag
from tests.pipeline.sources.made.captures import write_capture
from tests.pipeline.sources.made.clouds_on_disk import STAMPS_NS, write_clouds
from tests.pipeline.sources.made.nuscenes_on_disk import START_US, write_nuscenes
from tests.pipeline.sources.test_radiate import write_radiate
from tests.pipeline.sources.test_route_files import GPX


def small_bag(folder: Path, kind: Kind = "db3") -> Path:
    """A folder that is a ROS 2 bag or contains a ROS 1 bag."""
    if kind == "ros1":
        folder.mkdir()
        write_bag(folder / "drive.bag", kind, sweeps=2, every=50)
        return folder
    return write_bag(folder, kind, sweeps=2, every=50)


def images_and_track(folder: Path) -> Path:
    """A folder of two images and a GNSS track."""
    folder.mkdir()
    for index in range(2):
        cv2.imwrite(str(folder / f"{index}.png"), np.full((24, 40, 3), 90, np.uint8))
    points = "".join(f'<trkpt lat="48.{n}" lon="11.2"><time>2024-05-01T12:00:0{n}Z</time></trkpt>' for n in range(2))
    (folder / "track.gpx").write_text(GPX.format(1, 1, f"<trk><trkseg>{points}</trkseg></trk>"))
    return folder


two_of_nuscenes = partial(write_nuscenes, frames=2)
until_it_stands = partial(write_kitti360, frames=6)
three_of_radiate = partial(write_radiate, frames=3)
FILES = {
    "astyx lidar": (write_astyx, "astyx:{folder}", "lidar_vlp16/000002.txt"),
    "astyx image": (write_astyx, "astyx:{folder}", "camera_front/000002.jpg"),
    "astyx first calibration": (write_astyx, "astyx:{folder}", "calibration/000001.json"),
    "astyx calibration": (write_astyx, "astyx:{folder}", "calibration/000002.json"),
    "astyx labels": (write_astyx, "astyx:{folder}", "groundtruth_obj3d/000002.json"),
    "kitti velodyne": (write_kitti, "kitti:{folder}", "velodyne/0000000001.bin"),
    "kitti image": (write_kitti, "kitti:{folder}", "image_02/0000000001.png"),
    "kitti calibration": (write_kitti, "kitti:{folder}", "calib/0000000001.txt"),
    "kitti labels": (write_kitti, "kitti:{folder}", "label_2/0000000001.txt"),
    "kitti oxts": (write_kitti_raw, "kitti:{folder}", "oxts/data/0000000001.txt"),
    "kitti stamps": (write_kitti_raw, "kitti:{folder}", "velodyne_points/timestamps.txt"),
    "kitti raw cameras": (write_kitti_raw, "kitti:{folder}", "../calib_cam_to_cam.txt"),
    "kitti raw velodyne": (write_kitti_raw, "kitti:{folder}", "../calib_velo_to_cam.txt"),
    "kitti-360 poses": (until_it_stands, "kitti:{folder}", f"data_poses/{DRIVE}/cam0_to_world.txt"),
    "kitti-360 velodyne": (until_it_stands, "kitti:{folder}", "calibration/calib_cam_to_velo.txt"),
    "kitti-360 cameras": (until_it_stands, "kitti:{folder}", "calibration/perspective.txt"),
    "pcap": (write_capture, "pcap:{folder}/drive.pcap", "drive.pcap"),
    "video": (write_capture, "pcap:{folder}/drive.pcap", "drive.avi"),
    "sentences": (write_capture, "pcap:{folder}/drive.pcap", "drive.nmea"),
    "rig": (write_capture, "pcap:{folder}/drive.pcap", "drive.yaml"),
    "pcd": (write_clouds, "pcd:{folder}", f"{STAMPS_NS[0]}.pcd"),
    "pcd, compressed": (partial(write_clouds, encoding="binary_compressed"), "pcd:{folder}", f"{STAMPS_NS[1]}.pcd"),
    "rosbag": (small_bag, "rosbag:{folder}", "recording.db3"),
    "rosbag mcap": (partial(small_bag, kind="mcap"), "rosbag:{folder}", "recording.mcap"),
    "rosbag metadata": (small_bag, "rosbag:{folder}", "metadata.yaml"),
    "nuscenes sweep": (
        two_of_nuscenes,
        "nuscenes:{folder}",
        f"samples/LIDAR_TOP/n015__LIDAR_TOP__{START_US}.pcd.bin",
    ),
    "nuscenes files": (two_of_nuscenes, "nuscenes:{folder}", "v1.0-mini/sample_data.json"),
    "nuscenes sensors": (two_of_nuscenes, "nuscenes:{folder}", "v1.0-mini/calibrated_sensor.json"),
    "nuscenes poses": (two_of_nuscenes, "nuscenes:{folder}", "v1.0-mini/ego_pose.json"),
    "nuscenes boxes": (two_of_nuscenes, "nuscenes:{folder}", "v1.0-mini/sample_annotation.json"),
    "radiate sweep": (three_of_radiate, "radiate:{folder}", "velo_lidar/000002.csv"),
    "radiate times": (three_of_radiate, "radiate:{folder}", "velo_lidar.txt"),
    "radiate state": (three_of_radiate, "radiate:{folder}", "GPS_IMU_Twist/000002.txt"),
    "first of images": (images_and_track, "pictures:{folder}", "0.png"),
    "track of images": (images_and_track, "pictures:{folder}", "track.gpx"),
    "rosbag 1": (partial(small_bag, kind="ros1"), "rosbag:{folder}/drive.bag", "drive.bag"),
}

EDITS = st.lists(
    st.tuples(
        st.floats(0, 1, exclude_max=True),
        st.sampled_from(["cut", "drop", "insert", "replace", "double"]),
        st.one_of(
            st.binary(min_size=1, max_size=8), st.sampled_from([b"nan", b"1e999", b"-", b"9" * 30, b"null", b"{}"])
        ),
    ),
    min_size=1,
    max_size=4,
)


def damaged(data: bytes, edits: list[tuple[float, str, bytes]]) -> bytes:
    for place, kind, extra in edits:
        at = int(place * len(data))
        match kind:
            case "cut":
                data = data[:at]
            case "drop":
                data = data[:at] + data[at + len(extra) :]
            case "insert":
                data = data[:at] + extra + data[at:]
            case "replace":
                data = data[:at] + extra + data[at + len(extra) :]
            case "double":
                data = data[:at] + data[at : at + 400] + data[at:]
    return data


@pytest.mark.parametrize("what", FILES)
def test_damage(what: str, tmp_path: Path) -> None:
    write, uri, name = FILES[what]
    folder = write(tmp_path / "recording")
    path = folder / name
    whole = path.read_bytes()

    @settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(EDITS)
    def survives(edits: list[tuple[float, str, bytes]]) -> None:
        path.write_bytes(damaged(whole, edits))
        try:
            source = open_source(uri.format(folder=folder))
        except SourceError:
            return
        for index in range(len(source)):
            frame = source.frame(index)
            for branch in (frame.image,) if uri.startswith("pictures:") else (frame.sweep, frame.image):
                assert branch is not None or frame.notes, "a missing branch says why"
            if frame.sweep is not None:
                assert bool((abs(frame.sweep.points) < 1e7).all())
                assert frame.sweep.ring.max() < frame.sweep.channels
            source.truth(index)

    survives()
