"""Sensors on other wires than UDP and HTTP: receivers on TCP and serial lines, own motion on the CAN bus."""

from __future__ import annotations

import os
import re
import socket
import time
import tty
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import can
import numpy as np
import pytest

from pipeline.replay.messages import Message
from pipeline.replay.nmea_writer import sentences
from pipeline.sources.live.config import LiveConfig
from pipeline.sources.live.source import LiveSensors
from pipeline.types import EgoState, Frame, GnssFix
from pipeline.types.source import SourceError
from tests.pipeline.sources.live.bench import MS, fix_at, small_sweep
from tests.pipeline.sources.live.rig import Replaying, frames_until, free_port, loopback_config, opened

DBC = """\
VERSION ""
BU_: CAR
BO_ 256 SPEED: 8 CAR
 SG_ KMH : 0|16@1+ (0.01,0) [0|400] "km/h" CAR
BO_ 257 GYRO: 8 CAR
 SG_ YAW : 0|16@1- (0.01,0) [-300|300] "deg/s" CAR
"""


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
        ("a bit far away", DBC.replace("0|16@", "1000000|16@"), "beyond the 64 bytes of CAN FD"),
        ("a signal of a million bits", DBC.replace("0|16@", "0|1000000@"), "beyond the 64 bytes of CAN FD"),
        ("a message of a million bytes", re.sub(r": (\d+) ", ": 1000000 ", DBC, count=1), "beyond the 64 bytes"),
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


def test_a_receiver_on_a_serial_line_comes_goes_and_comes(sensors: list[LiveSensors]) -> None:
    """A pair of pseudo-terminals acts as a serial line; closing the other end unplugs it."""
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
