"""A path without a scheme is opened by its content, or answered with what it seems to be and what to do."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.commands.serve import Serve
from pipeline.sources import SourceError, open_source
from tests.pipeline.recording.frames import full, write
from tests.pipeline.sources.conftest import write_astyx, write_kitti, write_kitti_raw
from tests.pipeline.sources.kitti.test_kitti360 import write_kitti360
from tests.pipeline.sources.made.bags import write_bag
from tests.pipeline.sources.made.captures import write_capture
from tests.pipeline.sources.made.clouds_on_disk import write_clouds
from tests.pipeline.sources.made.nuscenes_on_disk import write_nuscenes

Write = Callable[[Path], Path]
"""Functions that create a recording in a new folder and return what a user types."""


def capture(folder: Path) -> Path:
    write_capture(folder)
    return folder / "drive.pcap"


def video(folder: Path) -> Path:
    write_capture(folder)
    (folder / "drive.pcap").unlink()
    return folder / "drive.avi"


def without_suffix(make: Write) -> Write:
    def renamed(folder: Path) -> Path:
        path = make(folder)
        return path.rename(path.with_suffix(""))

    return renamed


def ros1(folder: Path) -> Path:
    folder.mkdir()
    return write_bag(folder / "drive.bag", "ros1", 2)


def images(folder: Path) -> Path:
    folder.mkdir()
    for k in range(2):
        cv2.imwrite(str(folder / f"{k}.png"), np.zeros((40, 60, 3), np.uint8))
    return folder


def capitals(folder: Path) -> Path:
    for path in images(folder).iterdir():
        path.rename(folder / f"IMG_{path.stem}.PNG")
    return folder


def ros2_mcap(folder: Path) -> Path:
    (file,) = write_bag(folder, "mcap", sweeps=2).glob("*.mcap")
    return file.rename(folder.parent / "alone.mcap")


def without_lidar(folder: Path) -> Path:
    drive = write_kitti_raw(folder)
    shutil.rmtree(drive / "velodyne_points")
    return drive


def session(folder: Path) -> Path:
    folder.mkdir()
    return write(folder / "drive.mcap", [full(0)]).rename(folder / "drive")


def copies(make: Write) -> Write:
    """Two recordings in one folder."""

    def written(folder: Path) -> Path:
        make(folder / "one")
        make(folder / "two")
        return folder

    return written


RECORDINGS: dict[str, tuple[Write, str]] = {
    "astyx": (write_astyx, "AstyxSource"),
    "object folder of KITTI": (write_kitti, "KittiSource"),
    "raw drive of KITTI": (write_kitti_raw, "KittiSource"),
    "day of KITTI with one drive": (lambda folder: write_kitti_raw(folder).parent, "KittiSource"),
    "PCD folder": (write_clouds, "PcdSource"),
    "capture": (capture, "PcapSource"),
    "capture of no suffix": (without_suffix(capture), "PcapSource"),
    "capture with a video beside it, by their folder": (lambda folder: capture(folder).parent, "PcapSource"),
    "video": (video, "CameraAlone"),
    "video of no suffix": (without_suffix(video), "CameraAlone"),
    "video, by its folder": (lambda folder: video(folder / "Fahrt – Zürich").parent, "CameraAlone"),
    "ROS 1 bag": (ros1, "RosbagSource"),
    "session of no suffix": (session, "SessionSource"),
    "MCAP file of ROS 2": (ros2_mcap, "RosbagSource"),
    "drive of KITTI without a LiDAR": (without_lidar, "KittiSource"),
    "ROS 2 bag": (lambda folder: write_bag(folder, "db3", sweeps=2), "RosbagSource"),
    "images": (images, "CameraAlone"),
    "images of a camera that writes capitals": (capitals, "CameraAlone"),
    "images two folders down": (lambda folder: images_below(folder), "CameraAlone"),
}


def images_below(folder: Path) -> Path:
    (folder / "day").mkdir(parents=True)
    images(folder / "day" / "camera")
    return folder


@pytest.mark.parametrize("what", RECORDINGS)
def test_a_recording_opens_by_its_path_alone(what: str, tmp_path: Path) -> None:
    make, kind = RECORDINGS[what]
    source = open_source(str(make(tmp_path / "recording")))
    assert type(source).__name__ == kind
    assert len(source) > 0


def test_the_page_is_served_of_a_path_without_a_prefix(tmp_path: Path) -> None:
    engine = Serve(str(images_below(tmp_path / "recording"))).engine()
    assert engine is not None
    with pytest.raises(SourceError, match="the folder is empty"):
        Serve(str(empty_folder(tmp_path / "nothing"))).engine()


def some_file(name: str, data: bytes) -> Write:
    def written(folder: Path) -> Path:
        folder.mkdir()
        (folder / name).write_bytes(data)
        return folder / name

    return written


def holding(name: str) -> Write:
    def written(folder: Path) -> Path:
        (folder / name).mkdir(parents=True)
        return folder

    return written


def part_of_drive(name: str) -> Write:
    """A folder inside a KITTI drive."""
    return lambda folder: write_kitti_raw(folder) / name


def without_table(folder: Path, table: str) -> Path:
    write_nuscenes(folder)
    (folder / "v1.0-mini" / f"{table}.json").unlink()
    return folder


def empty_folder(folder: Path) -> Path:
    folder.mkdir()
    return folder


def link_to_itself(folder: Path) -> Path:
    folder.symlink_to(folder)
    return folder


def folder_in_itself(folder: Path) -> Path:
    folder.mkdir()
    (folder / "again").symlink_to(folder)
    return folder


def unrelated(folder: Path) -> Path:
    (folder / "radar").mkdir(parents=True)
    (folder / "a.csv").write_text("x")
    return folder


def thousands(folder: Path) -> Path:
    folder.mkdir()
    for k in range(1100):
        (folder / f"{k}.doc").touch()
    return folder


def pipe(folder: Path) -> Path:
    os.mkfifo(folder)
    return folder


OTHERS: dict[str, tuple[Write, str]] = {
    "nothing there": (lambda folder: folder, "no such file or folder; use one of session.mcap"),
    "empty folder": (empty_folder, "the folder is empty"),
    "empty file": (some_file("x", b""), "an empty file"),
    "text": (some_file("notes.txt", b"hello\n"), r"a text file \(\.txt\); use one of session.mcap"),
    "text of no suffix": (some_file("notes", b"hello\n"), "a text file; use one of"),
    "anything": (some_file("x.xyz1", b"\0\1\2\3"), r"a file of unknown content \(\.xyz1\)"),
    "one image": (some_file("a.jpg", b"\xff\xd8\xff"), "one image; open its folder"),
    "one image of no suffix": (some_file("a", b"\x89PNG\r\n"), "one image; open its folder"),
    "an image of another format": (some_file("a.bmp", b"BM"), "an image of an unsupported format; convert"),
    "a bare stream of images": (
        some_file("a.h264", b"\0\0\0\1g"),
        r"images without times; put .*ffmpeg .*a\.h264",
    ),
    "a network": (some_file("a.onnx", b"\x08"), "a network; use it as --detector or --lanes"),
    "the sweeps of a drive": (part_of_drive("velodyne_points"), r"a part of the recording .*_sync; open that folder$"),
    "the sweeps' files": (part_of_drive("velodyne_points/data"), r"a part of the recording .*_sync; open that folder$"),
    "a calibration": (
        lambda folder: part_of_drive("")(folder).parent / "calib_cam_to_cam.txt",
        r"a part of the recording .*; open that folder$",
    ),
    "the poses of KITTI-360": (
        lambda folder: write_kitti360(folder) / "data_poses",
        r"a part of the recording .*path; open that folder$",
    ),
    "nuScenes without a table": (
        lambda folder: without_table(folder, "sample_data"),
        r"v1\.0-mini/sample_data\.json is missing$",
    ),
    "one point cloud": (some_file("a.pcd", b"# .PCD v.7"), "one point cloud; open its folder"),
    "one sweep of KITTI": (some_file("000000.bin", b"\1\2\3\4"), "raw points or packets; open the folder"),
    "a GNSS track": (some_file("a.gpx", b"<gpx>"), "a GNSS track; open the video"),
    "an OpenSCENARIO file that is cut off": (
        some_file("a.xosc", b"<?xml"),
        "a.xosc, line 1: not XML: ",
    ),
    "an OpenDRIVE file": (some_file("a.xodr", b"<?xml"), r"an OpenDRIVE road network; open the OpenSCENARIO file"),
    "settings": (some_file("car.yaml", b"lidar:"), r"a settings file; use live:.*car\.yaml for sensors, sim:"),
    "an archive": (some_file("a.zip", b"PK\3\4"), "an archive; unpack it"),
    "an archive of no suffix": (some_file("a", b"PK\3\4"), "an archive; unpack it"),
    "a table": (some_file("a.csv", b"x,y,z"), "a point cloud or table; convert sweeps to PCD"),
    "an Ouster recording": (some_file("a.osf", b"\0"), "an Ouster recording; convert it to a ROS bag"),
    "a ROS 1 bag of no suffix": (without_suffix(ros1), "a ROS 1 bag; rename it so that it ends in .bag"),
    "a log of the bus": (some_file("a.blf", b"LOGG"), "without LiDAR and images"),
    "nuScenes without tables": (
        holding("samples/LIDAR_TOP"),
        "nuScenes without their tables; .* v1.0-mini or .* missing",
    ),
    "Argoverse 2": (holding("sensors/lidar"), "an unsupported Argoverse 2 log; convert it"),
    "poses alone": (holding("poses"), "poses of KITTI's odometry sequences; the folders with .* are missing"),
    "unrelated files": (
        unrelated,
        r"it holds 1 \.csv file and folder radar \(a\.csv: a point cloud or table; convert.*\)$",
    ),
    "thousands of files": (thousands, r"it holds at least 1000 \.doc files; use one of"),
    "two recordings": (copies(write_astyx), r"it holds recordings; open one of them, for example .*/one$"),
    "recordings two folders down": (
        lambda folder: copies(write_astyx)(folder / "a" / "b").parent,
        r"it holds recordings; open one of them, for example .*/a/b/one$",
    ),
    "a link to itself": (link_to_itself, "a broken link|cannot be read"),
    "a folder in itself": (folder_in_itself, "it holds folder again"),
    "a folder called like a session": (lambda folder: unrelated(folder / "x.mcap"), r"x\.mcap: not a source: it holds"),
    "a pipe": (pipe, "not a file or folder"),
    "a video's first bytes": (
        some_file("a", b"\0\0\0\x20ftypisom"),
        "a: not a readable video: cut off before its",
    ),
    "an empty video": (some_file("a.mp4", b""), r"a\.mp4: not a readable video: an empty file"),
    "text called a video": (some_file("a.mp4", b"hello"), r"a\.mp4: not a readable video: cut off, or something else"),
    "a capture's first bytes": (some_file("a", b"\xd4\xc3\xb2\xa1"), "a: no Velodyne packets .* the file is cut off"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_anything_else_is_answered_in_one_line(what: str, tmp_path: Path) -> None:
    make, says = OTHERS[what]
    with pytest.raises(SourceError, match=says) as error:
        open_source(str(make(tmp_path / "path")))
    assert "\n" not in str(error.value)


def test_a_scheme_may_name_the_folder_around_the_recording(tmp_path: Path) -> None:
    day = write_kitti_raw(tmp_path / "kitti").parent
    assert len(open_source(f"kitti:{day.parent}")) == len(open_source(str(day)))
    with pytest.raises(SourceError, match="not an Astyx recording"):
        open_source(f"astyx:{day}")


def test_options_follow_the_path_of_a_folder_that_stands_for_its_one_recording(tmp_path: Path) -> None:
    folder = video(tmp_path / "drive").parent
    assert len(open_source(f"{folder}?rate_hz=5")) < len(open_source(str(folder)))


def test_a_colon_in_a_name_is_no_scheme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(video(tmp_path / "drive"), tmp_path / "10:30.avi")
    monkeypatch.chdir(tmp_path)
    assert len(open_source("10:30.avi")) > 0


def test_what_must_not_be_read_is_refused_and_not_described(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "allowed").mkdir()
    (tmp_path / "secret.txt").write_text("x")
    monkeypatch.setenv("CIPV_FOLDERS", str(tmp_path / "allowed"))
    with pytest.raises(SourceError, match=r"secret\.txt: not a source: cannot be read: outside the allowed folders"):
        open_source(str(tmp_path / "secret.txt"))


def test_a_folder_that_may_not_be_listed_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(path: object) -> object:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("pipeline.sources.recognition.os.scandir", denied)
    with pytest.raises(SourceError, match=r"not a source: cannot be read: Permission denied$"):
        open_source(str(empty_folder(tmp_path / "closed")))


def test_a_question_mark_in_a_name_begins_no_options(tmp_path: Path) -> None:
    folder = tmp_path / "Straße 1 #2?x"
    folder.mkdir()
    file = shutil.copy(video(tmp_path / "drive"), folder / "what now?.avi")
    whole = len(open_source(str(file)))
    assert len(open_source(str(folder))) == len(open_source(f"video:{file}")) == whole
    assert len(open_source(f"{file}?rate_hz=5")) < whole


def test_the_address_of_a_file_is_its_path(tmp_path: Path) -> None:
    file = shutil.copy(video(tmp_path / "drive"), tmp_path / "Straße 1.avi")
    assert len(open_source(file.as_uri())) == len(open_source(str(file)))
    assert len(open_source(f"{file.as_uri()}?rate_hz=5")) < len(open_source(str(file)))


def test_images_say_which_recording_they_are_a_part_of(tmp_path: Path) -> None:
    drive = write_kitti_raw(tmp_path / "kitti")
    for part in ("image_02", "image_02/data"):
        notes = open_source(str(drive / part)).notes
        assert any(f"a part of the recording {drive}" in note for note in notes), notes
    assert not any("a part of" in note for note in open_source(str(images(tmp_path / "alone"))).notes)


def test_what_lies_beside_a_recording_is_no_part_of_it(tmp_path: Path) -> None:
    drive = write_kitti_raw(tmp_path / "kitti")
    note = some_file("notes.txt", b"hello\n")(drive.parent / "notes")
    for path in (note.parent, note):
        with pytest.raises(SourceError) as refused:
            open_source(str(path))
        assert "a part of" not in str(refused.value)


def test_images_say_what_lies_beside_them_unread(tmp_path: Path) -> None:
    folder = images(tmp_path / "alone")
    (folder / "000000.bin").write_bytes(bytes(16))
    shutil.copy(video(tmp_path / "drive"), folder / "drive.avi")
    notes = open_source(f"pictures:{folder}").notes
    assert any("1 .bin beside the images not used" in note for note in notes)
    assert any("drive.avi beside the images not used" in note for note in notes)
