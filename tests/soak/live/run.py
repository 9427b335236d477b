"""A soak of live sensors: the car in a process of its own, every fault there is, and all that runs in the vehicle."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import yaml

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.common.files.data_dir import data_dir
from pipeline.detection import detector_for, lanes_for
from pipeline.inference.model_registry import EMBEDDED
from pipeline.lanes.classical import NAME as CLASSICAL
from pipeline.lanes.open_detector import LaneDetector, usual_every
from pipeline.params import Params
from pipeline.replay.faults import Fault
from pipeline.sources import open_any
from pipeline.types.source import AnySource
from tests.conftest import ROOT
from tests.pipeline.sources.live.rig import loopback_config
from tests.soak.live import car as live_car
from tests.soak.live.report import QUIET_S, report
from tests.soak.live.watch import Memory, Watcher

KINDS = (
    ("lidar", "silence"), ("camera", "disconnect"), ("gnss", "silence"), ("lidar", "garbage"), ("camera", "silence"),
    ("lidar", "clock_jump"), ("camera", "garbage"), ("gnss", "clock_jump"), ("lidar", "out_of_order"),
    ("camera", "clock_jump"), ("gnss", "garbage"), ("lidar", "duplicate"), ("camera", "out_of_order"),
    ("gnss", "duplicate"), ("camera", "duplicate"), ("gnss", "out_of_order"), ("gnss", "disconnect"),
)  # fmt: skip
"""Every fault of a replayed sensor; over UDP a receiver that is unplugged is one that is silent. What else can befall
sensors is tested on a bench whose clock the tests move: own motion over CAN that stops or is damaged in
``test_own_motion.py``, PPS and GPS time against the host's in ``test_clock.py``, a camera of 60 Hz against a LiDAR of
10 in ``test_faults.py``, receivers over TCP and serial lines in ``test_wires.py``."""
FIRST_S, EVERY_S, LASTS_S = 6.0, 1.4, 1.2
CORES = 2
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Networks:
    """Names or files, as the program takes them."""

    detector: str
    lanes: str


OURS = Networks(EMBEDDED, CLASSICAL)


def for_real_roads(lanes: str = OURS.lanes) -> Networks:
    """The setting for real roads and two cores, YOLOX-nano and lanes without a network, where its file is here, else
    what comes with the program. lanes: a file of ``models``."""
    detector, network = data_dir() / "models" / "yolox_nano.onnx", data_dir() / "models" / lanes
    return Networks(
        str(detector) if detector.exists() else OURS.detector, str(network) if network.exists() else OURS.lanes
    )


@contextmanager
def on_two_cores() -> Iterator[list[int]]:
    """Bind this thread and those that it starts to two cores. Returns the remaining cores, or the same two if there are
    no others."""
    here = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, here[:CORES])
    try:
        yield here[CORES:] or here
    finally:
        os.sched_setaffinity(0, here)


def faults_for(seconds: float) -> list[Fault]:
    """The faults one after the other, as often as they fit, with a quiet end."""
    count = int((seconds - FIRST_S - QUIET_S) / EVERY_S)
    return [
        Fault.model_validate(
            {"sensor": sensor, "kind": kind, "from_s": FIRST_S + k * EVERY_S, "to_s": FIRST_S + k * EVERY_S + LASTS_S}
        )
        for k in range(count)
        for sensor, kind in (KINDS[k % len(KINDS)],)
    ]


def config_file(folder: Path) -> Path:
    """All sensors on loopback, the camera calibrated as the simulator's is."""
    config = loopback_config(lidar=None).model_dump(mode="json", exclude_none=True)
    config["lidar"] = loopback_config().lidar.model_dump(mode="json", exclude_none=True)  # type: ignore[union-attr]
    camera = live_car.camera()
    x, y, z = -camera.T_camera_ego[:3, :3].T @ camera.T_camera_ego[:3, 3]
    pitch = np.degrees(np.arcsin(np.clip(-camera.T_camera_ego[2, 2], -1.0, 1.0)))
    config["camera"]["calibration"] = {
        "fx_px": float(camera.K[0, 0]), "fy_px": float(camera.K[1, 1]), "cx_px": float(camera.K[0, 2]),
        "cy_px": float(camera.K[1, 2]), "width_px": camera.width, "height_px": camera.height,
        "mount": {"x_m": float(x), "y_m": float(y), "z_m": float(z), "pitch_deg": float(pitch)},
    }  # fmt: skip
    path = folder / "car.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


def soak(folder: Path, seconds: float, networks: Networks = OURS) -> dict[str, Any]:
    """Run the soak and measure."""
    with on_two_cores() as others:
        return _soak(folder, seconds, networks, others)


def _soak(folder: Path, seconds: float, networks: Networks, others: list[int]) -> dict[str, Any]:
    faults, config = faults_for(seconds), config_file(folder)
    faults_path = folder / "faults.yaml"
    faults_path.write_text(yaml.safe_dump([fault.model_dump() for fault in faults]), encoding="utf-8")
    watcher, desk = Watcher(), SessionRecorder(folder)
    lanes_every: list[int] = []

    def open_lanes(source: AnySource) -> LaneDetector | None:
        lanes = lanes_for(source, networks.lanes)
        lanes_every.append(usual_every(lanes, source.rate_hz))
        return lanes

    engine = Engine(
        open_any,
        lambda source: detector_for(source, networks.detector),
        Params(),
        uri=f"live:{config}",
        playing=True,
        open_lanes=open_lanes,
        recorder=desk,
    )
    engine.listen(watcher)
    engine.start()
    engine.wait_for(lambda s: s.live, PATIENCE_S)
    command = [sys.executable, "-m", "tests.soak.live.car", str(config), str(seconds), str(faults_path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as car:
        os.sched_setaffinity(car.pid, others)
        watcher.start_ns = int(_line(car.stdout))
        engine.wait_for(lambda s: s.processed is not None, PATIENCE_S)
        desk.start(engine.source)
        memory, cpu_s = Memory(), _cpu_s()
        told = json.loads(_line(car.stdout))
        memory.stop()
        cpu_s = _cpu_s() - cpu_s
        assert car.wait(PATIENCE_S) == 0
    assert engine.alive
    assert engine.source is not None
    dropped = engine.source.dropped  # type: ignore[union-attr]
    state = desk.stop()
    engine.stop()
    assert state is not None
    ran_with = {
        "detector": Path(networks.detector).name,
        "lanes": Path(networks.lanes).name,
        "lanes_every": lanes_every[0],
        "cores": min(CORES, len(os.sched_getaffinity(0))),
        "car_on_the_same_cores": set(others) <= os.sched_getaffinity(0),
    }
    return ran_with | report(seconds, faults, watcher, memory, cpu_s, told, dropped, state)


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _line(stream: IO[str] | None) -> str:
    assert stream is not None
    line = stream.readline()
    assert line, "the car ended before it should"
    return line
