"""A session of raw packets gives the sweeps that the pipeline processed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.common.geometry import rotation
from pipeline.formats.velodyne import VelodyneDecoder
from pipeline.recording.recorder import Recorder
from pipeline.recording.rewrite import recover
from pipeline.recording.save import save
from pipeline.recording.segments import FileRotation, Segments
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.velodyne_scan import RawLidar, packets_from
from pipeline.types import Frame, Sweep
from tests.pipeline.formats.velodyne.streams import drive
from tests.pipeline.recording.frames import ABOUT, full, same

SWEEPS = 24
OFFSET_NS = -12_000_000


def mounted() -> RawLidar:
    T_ego_lidar = np.eye(4)
    T_ego_lidar[:3, :3] = rotation(0.01, -0.02, 0.3)
    T_ego_lidar[:3, 3] = 0.1, -0.2, 0.3
    return RawLidar(T_ego_lidar, OFFSET_NS)


def record(recorder: Segments, lidar: RawLidar, behind: int = 0) -> list[Frame]:
    """Record packets as they arrive, and a frame for each completed sweep, delayed by this number of sweeps."""
    decoder, batch, frames = VelodyneDecoder(lidar.T_ego_lidar), [], []
    for packet, t_ns in drive(SWEEPS):
        sweep = decoder.push(packet, t_ns)
        batch.append((t_ns, packet))
        if len(batch) == 76:
            recorder.write_packets(batch)
            batch = []
        if sweep is not None:
            frame = replace(full(len(frames)), t_ns=sweep.t_ns, sweep=replace(sweep, t_ns=sweep.t_ns + OFFSET_NS))
            frames.append(frame)
            if len(frames) > behind:
                recorder.write(frames[-1 - behind], received_ns=t_ns + 30_000_000)
    recorder.write_packets(batch)
    for frame in frames[len(frames) - behind :]:
        recorder.write(frame, received_ns=t_ns + 60_000_000)
    recorder.close()
    return frames


def same_points(a: Sweep | None, b: Sweep | None) -> bool:
    assert a is not None
    assert b is not None
    return a.t_ns == b.t_ns and same((a.points.tobytes(), a.ring.tobytes()), (b.points.tobytes(), b.ring.tobytes()))


def test_sweeps_are_made_anew_of_their_packets(tmp_path: Path) -> None:
    lidar = mounted()
    frames = record(Segments(tmp_path / "a.mcap", ABOUT, raw_lidar=lidar), lidar)
    assert len(frames) >= SWEEPS - 2
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert not list(session.file.messages(("/lidar/points",)))
    assert [same_points(session.frame(k).sweep, frame.sweep) for k, frame in enumerate(frames)] == [True] * len(frames)
    recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    save(session, tmp_path / "c.mcap", 5, 8)
    again, part = (SessionSource(name, str(tmp_path / f"{name}.mcap")) for name in "bc")
    assert same_points(again.frame(5).sweep, frames[5].sweep)
    assert [same_points(part.frame(k).sweep, frames[5 + k].sweep) for k in range(4)] == [True] * 4


def test_a_pipeline_that_lags_behind_the_sensor_loses_no_sweep(tmp_path: Path) -> None:
    lidar = mounted()
    frames = record(Segments(tmp_path / "a.mcap", ABOUT, raw_lidar=lidar), lidar, behind=15)
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert [same_points(session.frame(k).sweep, frame.sweep) for k, frame in enumerate(frames)] == [True] * len(frames)


def test_a_new_file_begins_with_the_packets_of_its_first_sweep(tmp_path: Path) -> None:
    lidar = mounted()
    parts = Segments(tmp_path / "a.mcap", ABOUT, FileRotation(max_s=0.8), raw_lidar=lidar)
    frames = record(parts, lidar)
    assert len(parts.files) >= 3
    sessions = [SessionSource("a", str(path)) for path in parts.files]
    read = [session.frame(k).sweep for session in sessions for k in range(len(session))]
    assert [same_points(a, frame.sweep) for a, frame in zip(read, frames, strict=True)] == [True] * len(frames)


def test_packets_that_are_missing_cost_their_sweep_and_are_said(tmp_path: Path) -> None:
    parts = Segments(tmp_path / "a.mcap", ABOUT, raw_lidar=mounted())
    parts.write(full(0))
    parts.close()
    frame = SessionSource("a", str(tmp_path / "a.mcap")).frame(0)
    assert frame.sweep is None
    assert "lacks the packets" in frame.notes[-1]
    assert frame.image is not None


def test_packets_are_kept_as_they_came(tmp_path: Path) -> None:
    packets = [(10**18 + index, bytes([index]) * 1206) for index in range(76)]
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    recorder.put(full(0))
    assert recorder.put_packets(packets)
    recorder.stop()
    (stored,) = SessionSource("a", str(tmp_path / "a.mcap")).file.messages(("/lidar/packets",))
    assert packets_from(stored.data) == packets
    assert (stored.channel.schema_name, stored.channel.message_encoding) == ("velodyne_msgs/msg/VelodyneScan", "cdr")
