"""End to end over real sockets: a recording is sent back at true timing, and the live path sees what it holds."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from pipeline.detection import Detectors, detector_for
from pipeline.params import Params
from pipeline.replay.messages import of_frame, of_recording
from pipeline.run import advance
from pipeline.sources import open_source
from pipeline.sources.live.check import check
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.sources.live.source import LiveSensors
from pipeline.sources.pcap import PcapSource
from pipeline.step import State
from pipeline.types import Frame, Result
from tests.pipeline.sources.live.bench import MS, endless
from tests.pipeline.sources.live.rig import Replaying, frames_until, free_port, loopback_config, opened


def is_whole(frame: Frame) -> bool:
    return None not in (frame.sweep, frame.image, frame.ego, frame.gnss)


def leads(frames: list[Frame], params: Params, detectors: Detectors) -> list[Result]:
    state, results = State(), []
    for frame in frames:
        _, state, result, _ = advance(state, frame, params, detectors)
        results.append(result)
    return results


def test_a_drive_over_the_network_has_the_lead_of_the_recording(sensors: list[LiveSensors]) -> None:
    """The same drive and pipeline. The lead drives 23 m ahead at nearly ego speed, so one frame more or less does not
    matter; what remains are a VLP-16's steps of 0.2° and 2 mm, and JPEG compression."""
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
    imaged = [frame for frame in whole[2:] if frame.image is not None]
    assert len(imaged) >= len(whole) / 2, "on a busy machine, an image may come too late"
    for frame in imaged:
        assert frame.image is not None
        assert frame.image.t_ns is not None
        assert abs(frame.image.t_ns - frame.t_ns) < 60 * MS
        assert frame.image.encoded is not None, "the JPEG as it came"


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
            frames_until(source, lambda frame: frame.sweep is not None and frame.image is not None)
        lidar_only = loopback_config(camera=None, gnss=None, ego=None, lidar=config.lidar)
        with Replaying(lidar_only, endless()):
            alone = frames_until(source, lambda frame: frame.sweep is not None and frame.image is None)
            assert any("camera" in note for note in alone.notes)


def test_a_multicast_group_is_joined(sensors: list[LiveSensors]) -> None:
    port = free_port(socket.SOCK_DGRAM)
    lidar = {"data_port": port, "position_port": None, "interface": "127.0.0.1", "multicast_group": "239.255.77.77"}
    config = loopback_config(lidar=lidar, camera=None, gnss=None, ego=None)
    source = opened(config, sensors)
    with Replaying(config, endless()):
        frames_until(source, lambda frame: frame.sweep is not None)


def test_check_says_rates_clock_offsets_and_skew() -> None:
    config = loopback_config()
    with Replaying(config, endless()):
        reports = {report.health.sensor: report for report in check(LiveSensors("live:x", config), 2.5)}
    assert set(reports) == {"lidar", "camera", "gnss", "ego"}
    assert all(report.health.rate_hz is not None for report in reports.values())
    for sensor in ("lidar", "camera"):
        offset_ms = reports[sensor].clock_offset_ms
        assert offset_ms is not None
        assert -2.0 < offset_ms < 2000.0, "one machine, one clock: leap seconds or wrong units would be more"
    assert reports["camera"].skew_ms is not None
    assert abs(reports["camera"].skew_ms) < 60.0
    assert reports["ego"].clock_offset_ms is None


def test_two_programs_on_one_port_are_told_so(sensors: list[LiveSensors]) -> None:
    """One port: of the LiDAR's two, each program could come first at one."""
    lidar = {"data_port": free_port(socket.SOCK_DGRAM), "position_port": None, "interface": "127.0.0.1"}
    config = loopback_config(lidar=lidar, camera=None, gnss=None, ego=None)
    both = [opened(config, sensors) for _ in range(2)]
    told: list[LiveSensors] = []
    for _ in range(600):
        both[0].next(0.05)
        told = [each for each in both if "is in use by another program" in each.health()[0].note]
        if told:
            break
    assert len(told) == 1, "whichever came second"


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
    """MRPT's capture of a VLP-16 indoors: the original packets at their original times."""
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
