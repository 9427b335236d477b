"""Images without a LiDAR."""

from __future__ import annotations

import struct
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from pipeline.params import Params
from pipeline.sources import SourceError, open_source
from pipeline.step import State, step
from tests.pipeline.sources.made.captures import sentences

GPX = """<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="test"><trk><trkseg>
{}</trkseg></trk></gpx>"""


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Two seconds at 30 Hz in which the brightness of the image is the frame number."""
    file = tmp_path / "drive.mp4"
    with av.open(str(file), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height = 320, 180
        for k in range(60):
            image = np.full((180, 320, 3), 4 * k, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    return file


def track(seconds: int, speed_mps: float = 10.0) -> str:
    """Northwards from 48° N, a point a second."""
    points = (
        f'<trkpt lat="{48.0 + k * speed_mps / 111_200:.7f}" lon="11.0"><time>2024-05-01T12:00:{k:02d}Z</time></trkpt>'
        for k in range(seconds)
    )
    return GPX.format("\n".join(points))


def test_a_bare_video_is_a_recording_of_ten_frames_a_second(video: Path) -> None:
    source = open_source(str(video))
    assert (len(source), source.rate_hz) == (20, pytest.approx(10.0, abs=0.1))
    frame = source.frame(7)
    assert frame.image is not None
    assert frame.image.bgr.mean() == pytest.approx(4 * 21, abs=6), "the image of its time"
    assert frame.t_ns - source.t_ns(0) == pytest.approx(0.7e9, abs=2e6)
    assert frame.camera is not None
    assert frame.camera.K[0, 0] == pytest.approx(226.7, abs=0.1), "78° over the diagonal of 367 px"
    assert frame.sweep is None
    assert any("is assumed" in note for note in source.notes)
    _, result = step(State(), frame, Params())
    assert (result.ego, result.acc) == (None, None)


def test_a_track_beside_a_video_gives_own_motion(video: Path) -> None:
    video.with_suffix(".gpx").write_text(track(5))
    source = open_source(f"video:{video}")
    frame = source.frame(15)
    assert frame.ego is not None
    assert frame.ego.speed_mps == pytest.approx(10.0, abs=0.1)
    assert frame.gnss is not None
    assert frame.gnss.course_rad == pytest.approx(0.0, abs=0.01)
    _, result = step(State(), frame, Params())
    assert result.own_motion is not None
    assert result.own_motion.speed.source == "gnss"
    assert result.acc is not None


@pytest.mark.parametrize("suffix", [".nmea", ".nma", ".ubx.txt"])
def test_sentences_beside_a_video_are_found_by_its_name(suffix: str, video: Path) -> None:
    video.with_suffix(suffix).write_text("".join(sentences(range(4))), encoding="ascii")
    assert f"4 GNSS fixes from drive{suffix}, by the receiver's own time" in open_source(str(video)).notes


@pytest.mark.parametrize(("others", "is_used"), [((), True), (("other.mp4",), False), (("other.gpx",), False)])
def test_a_track_of_another_name_is_taken_where_it_can_only_be_the_videos(
    others: tuple[str, ...], is_used: bool, video: Path
) -> None:
    for name in ("ride.gpx", *others):
        (video.parent / name).write_text(track(5))
    notes = open_source(str(video)).notes
    assert ("5 GNSS fixes from ride.gpx" in notes) == is_used


def test_a_track_in_a_folder_of_images_is_taken(tmp_path: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.zeros((40, 60, 3), np.uint8))
    (tmp_path / "ride.gpx").write_text(track(5))
    ego = open_source(str(tmp_path)).frame(2).ego
    assert ego is not None
    assert ego.speed_mps == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize(("degrees", "corner"), [(0, (0, 0)), (90, (0, -1)), (180, (-1, -1)), (270, (-1, 0))])
def test_a_video_of_a_telephone_on_its_side_stands_upright(degrees: int, corner: tuple[int, int], video: Path) -> None:
    """The matrix in the file's track header states the clockwise rotation."""
    image = np.zeros((180, 320, 3), np.uint8)
    image[:60, :60] = 255
    with av.open(str(video), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height = 320, 180
        container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    data = video.read_bytes()
    at = data.index(b"tkhd") + 44
    c, s = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}[degrees]
    turned = struct.pack(">9i", c << 16, s << 16, 0, -s << 16, c << 16, 0, 0, 0, 1 << 30)
    video.write_bytes(data[:at] + turned + data[at + 36 :])
    frame = open_source(str(video)).frame(0)
    assert frame.image is not None
    assert frame.image.bgr.shape == ((180, 320, 3) if degrees % 180 == 0 else (320, 180, 3))
    rows, columns = ([slice(0, 20), slice(-20, None)][each] for each in corner)
    assert frame.image.bgr[rows, columns].mean() > 230
    assert frame.camera is not None
    assert (frame.camera.width, frame.camera.height) == frame.image.bgr.shape[1::-1]


def test_options_give_the_rate_and_the_camera(video: Path) -> None:
    source = open_source(f"{video}?rate_hz=30&hfov_deg=90")
    assert len(source) == 60
    camera = source.frame(0).camera
    assert camera is not None
    assert camera.K[0, 0] == pytest.approx(160.0)
    with pytest.raises(SourceError, match="hfov_deg=200: must be between 10 and 170"):
        open_source(f"{video}?hfov_deg=200")


def test_a_folder_of_images(tmp_path: Path) -> None:
    for k in range(3):
        cv2.imwrite(
            str(tmp_path / f"{1_700_000_000_000_000_000 + k * 200_000_000}.png"), np.full((40, 60, 3), k, np.uint8)
        )
    source = open_source(str(tmp_path))
    assert (len(source), source.rate_hz) == (3, 5.0)
    image = source.frame(2).image
    assert image is not None
    assert image.bgr[0, 0, 0] == 2
    (tmp_path / "1700000000900000000.png").write_bytes(b"\x89PNG cut")
    assert open_source(str(tmp_path)).frame(3).notes == ("1700000000900000000.png: the image is truncated",)


@pytest.mark.parametrize(
    "names", [("9999999999999998", "9999999999999999"), ("9223372036854775807", "9223372036854775808")]
)
def test_names_of_images_beyond_64_bits_are_no_times(names: tuple[str, str], tmp_path: Path) -> None:
    for name in names:
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((40, 60, 3), 9, np.uint8))
    source = open_source(f"pictures:{tmp_path}")
    assert [source.frame(index).t_ns for index in range(2)] == [0, 100_000_000]


@pytest.mark.parametrize("year", ["9999", "0001"])
def test_a_track_beyond_64_bits_of_time_is_said_in_one_line(year: str, video: Path) -> None:
    video.with_suffix(".gpx").write_text(track(5).replace("2024-", f"{year}-"))
    assert_no_track(str(video), "no track points with times")


def assert_no_track(file: str, reason: str) -> None:
    """The images are shown without the track, which the notes tell; a track that was asked for is an error."""
    source = open_source(file)
    assert source.frame(0).image is not None
    assert any(note.startswith(f"no GNSS track: drive.gpx: {reason}") for note in source.notes), source.notes
    with pytest.raises(SourceError, match=rf"drive\.gpx: {reason}"):
        open_source(f"{file}?gpx=drive.gpx")


def test_what_is_no_video_and_no_track_is_said_in_one_line(video: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.mp4").write_bytes(video.read_bytes()[:200])
    with pytest.raises(SourceError, match=r"cut\.mp4: not a readable video"):
        open_source(str(tmp_path / "cut.mp4"))
    video.with_suffix(".gpx").write_text("<gpx>")
    assert_no_track(str(video), "not XML")
    video.with_suffix(".gpx").write_text(GPX.format(""))
    assert_no_track(str(video), "no track points with times")


def test_images_of_several_sizes_have_an_assumed_calibration_each(tmp_path: Path) -> None:
    for name, (width, height) in {"0": (320, 180), "1": (640, 360), "2": (8, 8)}.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((height, width, 3), 9, np.uint8))
    source = open_source(f"pictures:{tmp_path}")
    cameras = [source.frame(index).camera for index in range(3)]
    assert [camera and (camera.width, camera.K[0, 0]) for camera in cameras] == [
        (320, pytest.approx(226.7, abs=0.1)),
        (640, pytest.approx(453.4, abs=0.2)),
        None,
    ]


@pytest.mark.parametrize("size", [(8, 400), (400, 8), (16_500, 16)])
def test_images_that_no_camera_makes_are_refused_in_one_line(size: tuple[int, int], tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((size[1], size[0], 3), np.uint8))
    with pytest.raises(SourceError, match=f"images of {size[0]}×{size[1]} pixels; they need 16 to 16384$"):
        open_source(f"pictures:{tmp_path}")


@pytest.mark.parametrize(
    "option", ["rate_hz=1e8", "rate_hz=1e-300", "hfov_deg=1e-9", "hfov_deg=170.1", "height_m=1e-9"]
)
@pytest.mark.parametrize("width", [16, 16_384])
def test_options_that_no_camera_has_are_refused_in_one_line(width: int, option: str, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((16, width, 3), np.uint8))
    open_source(f"pictures:{tmp_path}?rate_hz=1000&hfov_deg=10&height_m=0.1")
    with pytest.raises(SourceError, match=r"^\w+=\S+: must be between \S+ and \S+$"):
        open_source(f"pictures:{tmp_path}?{option}")
