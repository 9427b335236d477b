"""A session gives back every frame as it was put in, to the last bit, whichever is asked for first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from pipeline.params import Params, with_changes
from pipeline.recording.session.detections import BoxesRecord, Given, LanesRecord
from pipeline.recording.session.provenance import VERSION, About
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import SourceError, open_source
from pipeline.types import (
    REAL_VEHICLES,
    CameraCalibration,
    CameraImage,
    EgoState,
    Frame,
    GnssFix,
    RangeScan,
    RawBoxes,
    RawLanes,
    Route,
    Sweep,
)
from pipeline.types.source import is_simulated
from tests.pipeline.recording.frames import ABOUT, CAMERA, PERIOD_NS, TRUTH, full, image, same, sweep, write


def with_camera(distortion: int) -> Frame:
    return replace(full(0), camera=replace(CAMERA, distortion=np.linspace(0.0, 0.01, distortion)))


def loose_rotation() -> CameraCalibration:
    """A rotation read from a file with four decimals, which no quaternion represents exactly."""
    T_camera_ego = CAMERA.T_camera_ego.copy()
    T_camera_ego[0, 0] = 3.3e-4
    return replace(CAMERA, T_camera_ego=T_camera_ego)


FRAMES: dict[str, Frame] = {
    "everything": full(0),
    "nothing": Frame(0, "empty", 0),
    "no LiDAR": replace(full(0), sweep=None),
    "no camera": replace(full(0), image=None, camera=None),
    "an image that is no JPEG": replace(full(0), image=image(3, ".png", t_ns=5)),
    "a camera without stamps": replace(full(0), image=image(3)),
    "a sweep without times of points": replace(full(0), sweep=sweep(1)),
    "an empty sweep": replace(full(0), sweep=sweep(1, points=0)),
    "times before 1970": replace(full(0), t_ns=-5 * PERIOD_NS, sweep=sweep(1, t_ns=-5 * PERIOD_NS)),
    "no distortion": with_camera(0),
    "four coefficients": with_camera(4),
    "eight coefficients": with_camera(8),
    "a rotation that is one only nearly": replace(full(0), camera=loose_rotation()),
    "own motion without yaw rate": replace(full(0), ego=EgoState(1, 0.1 + 0.2)),
    "a fix that stands": replace(full(0), gnss=GnssFix(1, -33.3, 151.2, -1.5, None, 0.0, "single", 4.0)),
    "detections that it brings": replace(
        full(0),
        detections_given=True,
        raw_boxes=RawBoxes(
            "truth",
            np.array([[1.1, 2.2, 3.3, 4.4]], np.float32),
            np.array([0.7], np.float32),
            ("car",),
            replace(REAL_VEHICLES, coefficient=1300.1),
        ),
        raw_lanes=RawLanes(
            "truth", np.array([[0.1, 5.5]], np.float32), np.array([1.0], np.float32), np.array([-1], np.int32)
        ),
    ),
    "a drive that nobody looks at": replace(full(0), detections_given=True),
    "words of any kind": replace(full(0), name='été/"1"\n', notes=("größer als 5 °", "")),
}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_a_frame_comes_back_to_the_last_bit(frame: Frame, tmp_path: Path) -> None:
    session = open_source(str(write(tmp_path / "a.mcap", [frame])))
    assert same(session.frame(0), frame)
    assert session.truth(0) == TRUTH
    assert session.t_ns(0) == frame.t_ns


def test_every_field_is_written() -> None:
    """A new field must be written too, and added to this list."""
    known = {
        Frame: "index name t_ns sweep image camera ego raw_boxes notes gnss raw_lanes route streams timing_ms "
        "detections_given scans",
        Sweep: "t_ns points ring channels time_s origin",
        CameraImage: "t_ns bgr encoded",
        CameraCalibration: "K distortion T_camera_ego width height road_z_m",
        Route: "name lat_deg lon_deg sigma_m",
        RangeScan: "t_ns points values",
    }
    for kind, names in known.items():
        assert {field.name for field in fields(kind)} == set(names.split()), kind
        frame = full(0)
        made_anew = {"raw_boxes", "raw_lanes"}  # by the networks
        assert all(getattr(frame, field.name) is not None for field in fields(Frame) if field.name not in made_anew)


@pytest.mark.parametrize(
    ("given_of", "said"),
    [
        (Given(BoxesRecord("made", ((1.0, 2.0, 3.0, 4.0),), (), ("car",), REAL_VEHICLES)), "given boxes"),
        (Given(lanes=LanesRecord("made", ((1.0, 2.0),), (1.0,), ())), "given lane lines"),
    ],
)
def test_given_detections_that_do_not_fit_are_left_out_and_said(
    given_of: Given, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.recording.session.writer.given_of", lambda frame: given_of)
    frame = open_source(str(write(tmp_path / "a.mcap", [full(0)]))).frame(0)
    assert (frame.raw_boxes, frame.raw_lanes, frame.detections_given) == (None, None, True)
    assert frame.notes == (*full(0).notes, f"the {said} cannot be read")


def test_a_route_that_cannot_be_read_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.recording.session.writer.route_message", lambda route: b"{}")
    frame = open_source(str(write(tmp_path / "a.mcap", [full(0)]))).frame(0)
    assert frame.route is None
    assert frame.notes == (*full(0).notes, "a message of /route cannot be read")


finite = st.floats(allow_nan=False, allow_infinity=False)


@given(
    name=st.text(max_size=20),
    t_ns=st.integers(-(2**62), 2**62),
    notes=st.lists(st.text(max_size=30), max_size=3),
    speed=finite,
    yaw_rate=st.none() | finite,
    lat=finite,
    count=st.integers(0, 50),
)
def test_any_frame_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    name: str,
    t_ns: int,
    notes: list[str],
    speed: float,
    yaw_rate: float | None,
    lat: float,
    count: int,
) -> None:
    frame = replace(
        full(0),
        name=name.encode("utf-8", "replace").decode(),
        t_ns=t_ns,
        notes=tuple(note.encode("utf-8", "replace").decode() for note in notes),
        ego=EgoState(t_ns, speed, yaw_rate),
        gnss=replace(full(0).gnss, lat_deg=lat),  # type: ignore[type-var]
        sweep=sweep(count, points=count),
    )
    path = write(tmp_path_factory.mktemp("any") / "a.mcap", [frame])
    assert same(open_source(str(path)).frame(0), frame)


def test_frames_can_be_read_in_any_order(tmp_path: Path) -> None:
    frames = [full(index) for index in range(30)]
    session = open_source(f"mcap:{write(tmp_path / 'a.mcap', frames)}")
    assert len(session) == 30
    for index in (29, 0, 17, 3, 3, 28):
        assert same(session.frame(index), frames[index])
        assert session.t_ns(index) == frames[index].t_ns
    with pytest.raises(IndexError):
        session.frame(30)


def test_what_a_person_reads_about_it_is_the_recordings_own(tmp_path: Path) -> None:
    session = open_source(str(write(tmp_path / "a.mcap", [full(0)])))
    assert (session.title, session.rate_hz, session.notes) == (ABOUT.title, ABOUT.rate_hz, ABOUT.notes)


def test_a_session_of_the_simulator_is_simulated(tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path / "a.mcap", About("sim:straight", "Simulation", 10.0))
    writer.write(full(0))
    writer.close()
    assert is_simulated(open_source(str(tmp_path / "a.mcap")))
    assert not is_simulated(open_source(str(write(tmp_path / "b.mcap", [full(0)]))))


def test_drives_whose_times_jump_back_keep_their_order(tmp_path: Path) -> None:
    """Two drives in one recording, or a clock that was set."""
    times = [5, 6, 7, 1, 2, 3, 3]
    frames = [replace(full(index), t_ns=t * PERIOD_NS) for index, t in enumerate(times)]
    session = open_source(str(write(tmp_path / "a.mcap", frames)))
    assert [session.t_ns(index) for index in range(7)] == [t * PERIOD_NS for t in times]
    assert [same(session.frame(index), frames[index]) for index in range(7)] == [True] * 7


def test_an_image_shown_twice_is_stored_once(tmp_path: Path) -> None:
    shown = image(1, t_ns=PERIOD_NS)
    frames = [replace(full(index), image=shown) for index in range(3)]
    session = SessionSource("a", str(write(tmp_path / "a.mcap", frames)))
    assert sum(1 for _ in session.file.messages(("/camera/image",))) == 1
    assert session.frame(0).image is session.frame(1).image
    assert same(session.frame(2), frames[2])


def test_calibration_and_parameters_are_those_of_their_time(tmp_path: Path) -> None:
    other = replace(CAMERA, K=CAMERA.K * np.array([[1.1], [1.1], [1.0]]))
    frames = [replace(full(index), camera=CAMERA if index < 3 else other) for index in range(6)]
    params = [Params(), Params(), *[with_changes(Params(), {"cluster.z_weight": 0.35})] * 4]
    writer = SessionWriter(tmp_path / "a.mcap", ABOUT)
    for frame, used in zip(frames, params, strict=True):
        writer.write(frame, {"frame": frame.name}, used)
    writer.close()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert [session.params(index) for index in (5, 0, 2, 1)] == [params[index] for index in (5, 0, 2, 1)]
    assert same(session.frame(2).camera, CAMERA)
    assert same(session.frame(3).camera, other)
    assert session.result(4) == {"frame": "000004"}
    counts = {topic: sum(1 for _ in session.file.messages((topic,))) for topic in ("/params", "/camera/calibration")}
    assert counts == {"/params": 2, "/camera/calibration": 2}


def test_a_session_of_inputs_alone_has_neither_parameters_nor_results(tmp_path: Path) -> None:
    session = SessionSource("a", str(write(tmp_path / "a.mcap", [full(0)])))
    assert session.params(0) is None
    assert session.result(0) is None


def test_marks_stay_with_their_moment(tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path / "a.mcap", ABOUT)
    for index in range(3):
        writer.write(full(index))
        if index == 1:
            writer.write_mark("cut in from the left")
    writer.close()
    assert SessionSource("a", str(tmp_path / "a.mcap")).marks() == ((2 * PERIOD_NS, "cut in from the left"),)


def test_the_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    first, second = (write(tmp_path / name, [full(index) for index in range(5)]) for name in ("a.mcap", "b.mcap"))
    assert first.read_bytes() == second.read_bytes()


def _foreign(path: Path, profile: str) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile)
        channel = writer.register_channel("/x", "json", 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()


def _of_the_future(path: Path) -> None:
    writer = SessionWriter(path, replace(ABOUT, version=VERSION + 1))
    writer.write(full(0))
    writer.close()


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "not there": (lambda path: None, "No such file"),
    "a folder": (lambda path: path.mkdir(), "Is a directory"),
    "empty": (lambda path: path.write_bytes(b""), "not an MCAP file"),
    "text": (lambda path: path.write_text("hello"), "not an MCAP file"),
    "no more than the magic": (
        lambda path: path.write_bytes(b"\x89MCAP0\r\n"),
        "a damaged MCAP file: it has no header",
    ),
    "overwritten": (lambda path: path.write_bytes(b"x" * 99 + b"\x89MCAP0\r\n"), "a damaged MCAP file: its beginning"),
    "of ROS 2": (lambda path: _foreign(path, "ros2"), "try rosbag:"),
    "of someone else": (lambda path: _foreign(path, ""), "not a session of CIPV Studio"),
    "without frames": (lambda path: SessionWriter(path, ABOUT).close(), "holds no frames"),
    "from a later version": (_of_the_future, "version 2"),
}


@pytest.mark.parametrize(("make", "complaint"), WRONG.values(), ids=WRONG)
def test_a_file_that_is_no_session_is_named_with_the_reason(
    make: Callable[[Path], object], complaint: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    make(path)
    with pytest.raises(SourceError, match=complaint) as raised:
        open_source(f"mcap:{path}")
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)
