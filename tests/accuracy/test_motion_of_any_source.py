"""A drive without recorded own motion gives the same LiDAR odometry from whatever it was recorded in: a session, a ROS
bag, a capture of packets, PCD files."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from pipeline.detection import Detectors
from pipeline.experiments.streets.scenarios import Street, scenario
from pipeline.formats.velodyne.encode import packets_of
from pipeline.params import Params
from pipeline.recording.session.writer import SessionWriter
from pipeline.run import through
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.sources import open_source
from pipeline.types import Frame, Sweep
from tests.pipeline.recording.frames import ABOUT
from tests.pipeline.sources.made.bags import BagWriter
from tests.pipeline.sources.made.captures import pcap
from tests.pipeline.sources.made.clouds_on_disk import pcd, rows_of

START_NS = 1_700_000_000 * 10**9
STREET = Street(150.0, "mixed", "nothing")
FRAMES = 9


@cache
def sweeps() -> tuple[Sweep, ...]:
    """Of a simulated street."""
    scene = scenario(STREET, 1)
    sensors = SensorRig(scene, scene.ego.start_m + scene.ego.travelled_m(scene.duration_s))
    found = []
    for index in range(FRAMES):
        now = world_state.at(scene, index / scene.rate_hz)
        frame = sensors.frame(now, index, START_NS + round(now.t_s * 1e9), image=False)
        assert frame.sweep is not None
        found.append(frame.sweep)
    return tuple(found)


def session(folder: Path) -> Path:
    writer = SessionWriter(folder / "drive.mcap", ABOUT)
    for index, sweep in enumerate(sweeps()):
        writer.write(Frame(index, f"{index:06d}", sweep.t_ns, sweep=sweep))
    writer.close()
    return folder / "drive.mcap"


def bag(folder: Path) -> Path:
    with BagWriter(folder / "bag", "db3") as writer:
        for sweep in sweeps():
            writer.write("/velodyne_points", writer.cloud(sweep, sweep.t_ns), sweep.t_ns)
    return folder / "bag"


def capture(folder: Path) -> Path:
    datagrams = []
    for sweep in sweeps():
        packets = packets_of(sweep)
        datagrams += [
            (sweep.t_ns + round((n / len(packets) - 0.5) * 1e8), 2368, packet) for n, packet in enumerate(packets)
        ]
    (folder / "drive.pcap").write_bytes(pcap(datagrams))
    return folder / "drive.pcap"


def clouds(folder: Path) -> Path:
    for sweep in sweeps():
        (folder / f"{sweep.t_ns}.pcd").write_bytes(pcd(rows_of(sweep)))
    return folder


@pytest.mark.parametrize("recorded", [session, bag, capture, clouds])
def test_speed_and_yaw_rate_come_from_the_sweeps(recorded: Callable[[Path], Path], tmp_path: Path) -> None:
    source = open_source(str(recorded(tmp_path)))
    frames = [source.frame(index) for index in range(len(source))]
    assert len(frames) >= FRAMES - 1
    results = [result for _, result in through(frames, Params(), Detectors())]
    assert results[0].ego is None
    last = results[-1]
    assert last.ego is not None
    assert last.ego.source == "lidar"
    assert last.ego.speed_mps == pytest.approx(STREET.speed_mps, abs=0.4)
    assert last.ego.yaw_rate_radps == pytest.approx(0.0, abs=0.02)
    assert last.acc is not None
    assert any(item.moving is not None for item in last.objects)
