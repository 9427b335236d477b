"""A car for the soak: `python -m tests.soak.live.car CONFIG SECONDS FAULTS`.

In its own process, like real sensors: LiDAR at 10 Hz, camera 1280×720 at 30 Hz, GNSS at 10 Hz, from two seconds of a
simulated drive that is played back and forth. Prints its start time (unix ns) on a line and, at the end, what it sent,
as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from pipeline.replay.faults import load as load_faults
from pipeline.replay.messages import Message
from pipeline.replay.replayer import replay
from pipeline.replay.senders import open_senders
from pipeline.simulation import scenario
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.sources.live.config import load
from pipeline.types import CameraCalibration, Frame

SCENARIO, FROM_S, SPAN = "straight", 8.6, 20
MS = 1_000_000
LEAD_M = (22.0, 25.5)
"""Minimum and maximum distance of the car ahead in these two seconds."""


def clip() -> tuple[list[Frame], list[bytes]]:
    """``SPAN`` frames of the LiDAR, with three images each."""
    drive = scenario.load(SCENARIO)
    sensors = SensorRig(drive, world_state.at(drive, drive.duration_s).s_m)
    frames, jpegs = [], []
    for number in range(3 * SPAN):
        frame = sensors.frame(world_state.at(drive, FROM_S + number / 30.0), number, 0)
        if number % 3 == 0:
            frames.append(frame)
        assert frame.image is not None
        jpegs.append(bytes(cv2.imencode(".jpg", frame.image.bgr, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()))
    return frames, jpegs


def camera() -> CameraCalibration:
    drive = scenario.load(SCENARIO)
    return SensorRig(drive, 0.0).camera


def messages(frames: list[Frame], jpegs: list[bytes], seconds: float) -> Iterator[Message]:
    for tick in range(round(seconds * 10)):
        for third in range(3):
            at_ns = tick * 100 * MS + third * 33_333_333
            if third == 0:
                frame = frames[_to_and_fro(tick, len(frames))]
                assert frame.sweep is not None
                assert frame.gnss is not None
                yield Message(at_ns, "lidar", frame.sweep)
                yield Message(at_ns, "gnss", frame.gnss)
            yield Message(at_ns + 5 * MS, "camera", jpegs[_to_and_fro(3 * tick + third, len(jpegs))])


def _to_and_fro(number: int, count: int) -> int:
    place = number % (2 * count - 2)
    return int(np.minimum(place, 2 * count - 2 - place))


def main(config_file: str, seconds: str, faults_file: str) -> None:
    config = load(config_file)
    faults = load_faults(Path(faults_file))
    frames, jpegs = clip()
    senders = open_senders(config)
    start_ns = time.time_ns() + 500 * MS
    print(start_ns, flush=True)
    sent = replay(messages(frames, jpegs, float(seconds)), senders, faults=faults, start_ns=start_ns)
    for sender in senders.values():
        sender.close()
    print(json.dumps({"sent": sent.events, "late": sent.late, "slips": sent.slips}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
