"""End to end over real sockets: a recording is sent back at true timing, and the live path sees what it holds."""

from __future__ import annotations

import os
import socket
import threading
import time
import tty
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from pathlib import Path

import av
import can
import numpy as np
import pytest

from pipeline.params import Params
from pipeline.replay.messages import Message, of_frame, of_recording
from pipeline.replay.nmea_writer import sentences
from pipeline.run import Detectors, advance, detector_for
from pipeline.sources import open_source
from pipeline.sources.base import SourceError
from pipeline.sources.live.check import check
from pipeline.sources.live.config import LiveConfig
from pipeline.sources.live.lidar import LidarInput
from pipeline.sources.live.source import LiveSensors
from pipeline.sources.pcap import PcapSource
from pipeline.step import State
from pipeline.types import EgoState, Frame, GnssFix, Result

from .bench import MS, fix_at, messages, small_sweep
from .rig import Replaying, frames_until, free_port, loopback_config

DBC = """\
VERSION ""
BU_: CAR
BO_ 256 SPEED: 8 CAR
 SG_ KMH : 0|16@1+ (0.01,0) [0|400] "km/h" CAR
BO_ 257 GYRO: 8 CAR
 SG_ YAW : 0|16@1- (0.01,0) [-300|300] "deg/s" CAR
"""


def endless(camera_hz: float = 30.0) -> Iterator[Message]:
    """The bench's sensors, without end."""
    for second in count():
        for message in messages(1.0, camera_hz):
            yield message._replace(t_ns=message.t_ns + second * 1000 * MS)


@pytest.fixture
def sensors() -> Iterator[list[LiveSensors]]:
    """What is put in here is closed."""
    opened: list[LiveSensors] = []
    yield opened
    for each in opened:
        each.close()


def opened(config: LiveConfig, sensors: list[LiveSensors]) -> LiveSensors:
    source = LiveSensors("live:loopback", config)
    sensors.append(source)
    source.start()
    return source


def is_whole(frame: Frame) -> bool:
    return None not in (frame.sweep, frame.picture, frame.ego, frame.gnss)


def leads(frames: list[Frame], params: Params, detectors: Detectors) -> list[Result]:
    state, results = State(), []
    for frame in frames:
        _, state, result = advance(state, frame, params, detectors)
        results.append(result)
    return results


def test_a_drive_over_the_network_has_the_lead_of_the_recording(sensors: list[LiveSensors]) -> None:
    """Same drive, same line. The lead drives 23 m ahead at nearly our speed, so that a frame more or less is no matter;
    what remains is a VLP-16's steps of 0.2° and 2 mm, and the JPEG."""
    recording = open_source("sim:straight")
    recorded = [recording.frame(index) for index in range(86, 100)]
    camera = recorded[0].camera
    assert camera is not None
    detectors, params = Detectors(detector_for(recording)), Params()
    config = loopback_config()
    source = opened(config, sensors)
    source.camera = camera
    live: list[Frame] = []
    with Replaying(config, (message for frame in recorded for message in of_frame(frame))):
        frames_until(source, lambda frame: is_whole(frame) and len(live) > 10, live)
    whole = [frame for frame in live if frame.sweep is not None]
    direct = leads(recorded, params, detectors)[-1].cipv
    over_network = leads(whole, params, detectors)[-1].cipv
    assert direct is not None
    assert over_network is not None
    assert over_network.distance_m == pytest.approx(direct.distance_m, abs=0.3)
    for frame in whole[2:]:
        assert frame.picture is not None
        assert frame.picture.t_ns is not None
        assert abs(frame.picture.t_ns - frame.t_ns) < 60 * MS
        assert frame.picture.encoded is not None, "the JPEG as it came"


def test_sensors_missing_at_the_start_are_there_when_they_are_plugged_in(sensors: list[LiveSensors]) -> None:
    config = loopback_config()
    source = opened(config, sensors)
    assert source.next(0.5) is None
    assert {each.sensor: each.state for each in source.health()} == dict.fromkeys(
        ("lidar", "camera", "gnss", "ego"), "absent"
    )
    assert "Connection refused" in next(each.note for each in source.health() if each.sensor == "camera")
    with Replaying(config, endless()):
        frame = frames_until(source, is_whole)
    assert all(each.state == "ok" for each in frame.streams)


def test_a_camera_that_is_pulled_out_and_put_back_is_back(sensors: list[LiveSensors]) -> None:
    config = loopback_config(gnss=None, ego=None)
    source = opened(config, sensors)
    for _ in range(2):
        with Replaying(config, endless()):
            frames_until(source, lambda frame: frame.sweep is not None and frame.picture is not None)
        lidar_only = loopback_config(camera=None, gnss=None, ego=None, lidar=config.lidar)
        with Replaying(lidar_only, endless()):
            alone = frames_until(source, lambda frame: frame.sweep is not None and frame.picture is None)
            assert any("camera" in note for note in alone.notes)


def test_a_receiver_on_tcp_and_own_motion_by_can(sensors: list[LiveSensors], tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DBC, encoding="ascii")
    channel = f"car-{free_port(socket.SOCK_STREAM)}"
    by_can = {
        "interface": "virtual",
        "channel": channel,
        "dbc": str(tmp_path / "car.dbc"),
        "speed_mps": {"message": "SPEED", "signal": "KMH", "factor": 1 / 3.6},
        "yaw_rate_radps": {"message": "GYRO", "signal": "YAW", "factor": np.pi / 180},
    }
    config = loopback_config(
        camera=None,
        gnss={"tcp": f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"},
        ego={"source": "can", "can": by_can},
    )
    source = opened(config, sensors)

    def sent() -> Iterator[Message]:
        for k in count():
            yield Message(k * 100 * MS, "lidar", small_sweep(0))
            yield Message((k * 100 + 1) * MS, "gnss", fix_at(0))
            yield Message((k * 100 + 2) * MS, "ego", EgoState(0, 25.0, -0.1))

    with Replaying(config, sent()):
        frame = frames_until(source, lambda frame: frame.gnss is not None and _yaw_rate(frame) is not None)
    assert frame.ego is not None
    assert frame.ego.speed_mps == pytest.approx(25.0, abs=0.003)
    assert frame.ego.yaw_rate_radps == pytest.approx(-0.1, abs=0.0002)
    assert isinstance(frame.gnss, GnssFix)
    assert frame.gnss.lat_deg == pytest.approx(48.0)


def test_garbage_on_the_can_bus_is_counted_and_passes_by(sensors: list[LiveSensors], tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DBC, encoding="ascii")
    channel = f"car-{free_port(socket.SOCK_STREAM)}"
    speed = {"message": "SPEED", "signal": "KMH", "factor": 1 / 3.6}
    by_can = {"interface": "virtual", "channel": channel, "dbc": str(tmp_path / "car.dbc"), "speed_mps": speed}
    config = loopback_config(camera=None, gnss=None, ego={"source": "can", "can": by_can})
    source = opened(config, sensors)

    def sent() -> Iterator[Message]:
        for k in count():
            yield Message(k * 100 * MS, "lidar", small_sweep(0))
            yield Message((k * 100 + 2) * MS, "ego", EgoState(0, 25.0))

    with Replaying(config, sent()), can.Bus(interface="virtual", channel=channel) as bus:
        frames_until(source, lambda frame: frame.ego is not None)
        bus.send(can.Message(arbitration_id=256, data=b"\x01", is_extended_id=False))
        bus.send(can.Message(arbitration_id=999, data=b"\xff" * 8, is_extended_id=False))
        frames_until(source, lambda frame: next(s.lost for s in frame.streams if s.sensor == "ego") == 1)
        frame = frames_until(source, lambda frame: frame.ego is not None)
    assert frame.ego is not None
    assert frame.ego.yaw_rate_radps is None


def _yaw_rate(frame: Frame) -> float | None:
    return frame.ego.yaw_rate_radps if frame.ego is not None else None


@pytest.mark.parametrize(
    ("case", "dbc", "complaint"),
    [
        ("not there", None, "No such file"),
        ("no DBC", "hello", "not a DBC"),
        ("no such signal", DBC, "no signal V"),
    ],
)
def test_a_dbc_file_without_the_signals_is_said_at_once(
    tmp_path: Path, case: str, dbc: str | None, complaint: str
) -> None:
    path = tmp_path / "car.dbc"
    if dbc is not None:
        path.write_text(dbc, encoding="ascii")
    by_can = {"dbc": str(path), "speed_mps": {"message": "SPEED", "signal": "V"}}
    config = LiveConfig.model_validate({"lidar": {}, "ego": {"source": "can", "can": by_can}})
    with pytest.raises(SourceError, match=complaint):
        LiveSensors("live:x", config)


def test_a_multicast_group_is_joined(sensors: list[LiveSensors]) -> None:
    port = free_port(socket.SOCK_DGRAM)
    lidar = {"data_port": port, "position_port": None, "interface": "127.0.0.1", "multicast_group": "239.255.77.77"}
    config = loopback_config(lidar=lidar, camera=None, gnss=None, ego=None)
    source = opened(config, sensors)
    with Replaying(config, endless()):
        frames_until(source, lambda frame: frame.sweep is not None)


def test_a_video_file_is_a_camera(sensors: list[LiveSensors], tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    film(path, 5)
    config = LiveConfig.model_validate({"camera": {"file": str(path)}})
    source = opened(config, sensors)
    seen: list[Frame] = []
    frames_until(source, lambda frame: len(seen) > 7, seen)
    shades = {round(float(each.picture.bgr.mean()) / 60) for each in seen if each.picture is not None}
    assert len(shades) >= 3, "it plays, and begins again at its end"
    assert "it sends none of its own" in seen[-1].streams[0].note


def test_what_is_not_a_video_is_said_and_tried_again(sensors: list[LiveSensors], tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    path.write_bytes(b"no video")
    source = opened(LiveConfig.model_validate({"camera": {"file": str(path)}}), sensors)
    assert source.next(0.6) is None
    assert "drive.mp4" in source.health()[0].note
    assert source.health()[0].state == "absent"


def test_check_says_rates_clock_offsets_and_skew() -> None:
    config = loopback_config()
    with Replaying(config, endless()):
        reports = {report.health.sensor: report for report in check(LiveSensors("live:x", config), 2.5)}
    assert set(reports) == {"lidar", "camera", "gnss", "ego"}
    assert all(report.health.rate_hz is not None for report in reports.values())
    for sensor in ("lidar", "camera"):
        offset_ms = reports[sensor].clock_offset_ms
        assert offset_ms is not None
        assert -2.0 < offset_ms < 200.0, "one machine, one clock: the way over loopback is all there is"
    assert reports["camera"].skew_ms is not None
    assert abs(reports["camera"].skew_ms) < 60.0
    assert reports["ego"].clock_offset_ms is None


def test_two_programs_on_one_port_are_told_so(sensors: list[LiveSensors]) -> None:
    config = loopback_config(camera=None, gnss=None, ego=None)
    opened(config, sensors)
    second = opened(config, sensors)
    assert second.next(0.5) is None
    assert "is taken by another program" in second.health()[0].note


def test_closing_twice_is_safe_and_gives_the_port_back(sensors: list[LiveSensors]) -> None:
    config = loopback_config(camera=None, gnss=None, ego=None)
    first = opened(config, sensors)
    first.next(0.1)
    first.close()
    first.close()
    again = opened(config, sensors)
    with Replaying(config, endless()):
        frames_until(again, lambda frame: frame.sweep is not None)


def test_a_real_capture_sent_back_is_decoded_as_its_file_is(sensors: list[LiveSensors], data_dir: Path) -> None:
    """MRPT's capture of a VLP-16 indoors, its own packets at their own times."""
    recording = open_source(f"pcap:{data_dir / 'vlp16_packets' / 'mrpt_sample_velodyne_vlp16_gps.pcap'}")
    assert isinstance(recording, PcapSource)
    direct = [recording.frame(index).sweep for index in range(len(recording))]
    config = loopback_config(camera=None, gnss=None, ego=None)
    source = opened(config, sensors)
    packets: list[bytes] = []
    lidar = source.inputs["lidar"]
    assert isinstance(lidar, LidarInput)
    lidar.on_packet = lambda packet, arrived_ns: packets.append(packet)
    live: list[Frame] = []
    with Replaying(config, of_recording(recording)) as replaying:
        frames_until(source, lambda frame: len(live) >= min(8, len(direct) - 2), live)
    over_network = {len(frame.sweep.points) for frame in live if frame.sweep is not None}
    known = {len(sweep.points) for sweep in direct if sweep is not None}
    assert set(packets) <= {payload for _, payload in recording.packets()}, "as they were"
    assert replaying.sent is not None
    assert len(over_network & known) >= 0.7 * len(over_network), "whole sweeps are the file's own"
    assert lidar.pps is not None, "position packets come to their own port"


def test_a_receiver_on_a_serial_line_comes_goes_and_comes(sensors: list[LiveSensors]) -> None:
    """A pair of pseudo-terminals is a serial line; closing its other end pulls the plug."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    config = LiveConfig.model_validate({"lidar": {"data_port": free_port(socket.SOCK_DGRAM), "position_port": None},
                                        "gnss": {"serial": os.ttyname(theirs)}})  # fmt: skip
    source = opened(config, sensors)
    for k in range(1000):
        os.write(ours, b"garbage\n" + sentences(fix_at(0), time.time_ns()))
        if k >= 4 and source.health()[1].state == "ok":
            break
        source.next(0.05)
    health = source.health()[1]
    assert health.state == "ok"
    assert health.lost > 0, "the garbage"
    os.close(ours)
    os.close(theirs)
    for _ in range(1000):
        source.next(0.02)
        if source.health()[1].note:
            break
    assert source.health()[1].note, "it says that the line is gone"


def test_video_over_http_is_a_camera_too(sensors: list[LiveSensors], tmp_path: Path) -> None:
    film(tmp_path / "drive.mp4", 12)
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            url = f"http://127.0.0.1:{server.server_address[1]}/drive.mp4"
            source = opened(LiveConfig.model_validate({"camera": {"url": url}}), sensors)
            frame = frames_until(source, lambda frame: frame.picture is not None)
            source.close()
        finally:
            server.shutdown()
            thread.join()
    assert frame.picture is not None
    assert frame.picture.bgr.shape == (48, 64, 3)


def test_a_camera_that_is_not_plugged_in_is_said(sensors: list[LiveSensors]) -> None:
    source = opened(LiveConfig.model_validate({"camera": {"device": 63}}), sensors)
    for _ in range(600):
        source.next(0.05)
        if source.health()[0].note:
            break
    assert "camera 63: not plugged in" in source.health()[0].note


def film(path: Path, count: int) -> None:
    """A video of grey pictures, each brighter than the one before."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for shade in np.linspace(0, 240, count).astype(np.uint8):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
