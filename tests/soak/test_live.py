"""Live sensors for half a minute, or ten minutes (`make soak`), with every fault there is: nothing crashes, memory
stays, every sensor that returns is used again, the recording is complete, and the page's frames are young.

The car is a process of its own on loopback. Here run the readers, the line with its network and lane detector, the
encoder of the page's frames, and the recorder. The short form runs what comes with the program and judges what does not
depend on how busy the machine is. The long form runs the network for real roads where it is here, on two cores; the
report says which.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
import yaml

from app.encode import Encoder
from app.engine import Engine
from app.recording import RecordingDesk
from app.snapshot import Snapshot
from pipeline.data import data_dir
from pipeline.params import Params
from pipeline.path.lane_classical import NAME as CLASSICAL
from pipeline.path.lane_detector import LaneDetector, usual_every
from pipeline.recording.session import SessionSource
from pipeline.recording.tick import tick_from
from pipeline.recording.topics import FRAMES, IMAGE, POINTS
from pipeline.replay.faults import Fault
from pipeline.run import detector_for, lanes_for
from pipeline.sources import open_any
from pipeline.sources.base import AnySource
from pipeline.types import Frame
from pipeline.vision.models import EMBEDDED
from tests.conftest import ROOT
from tests.pipeline.sources.live.rig import loopback_config
from tests.soak import live_car

KINDS = (
    ("lidar", "silence"), ("camera", "disconnect"), ("gnss", "silence"), ("lidar", "garbage"), ("camera", "silence"),
    ("lidar", "clock_jump"), ("camera", "garbage"), ("gnss", "clock_jump"), ("lidar", "out_of_order"),
    ("camera", "clock_jump"), ("gnss", "garbage"), ("lidar", "duplicate"), ("camera", "out_of_order"),
    ("gnss", "duplicate"), ("camera", "duplicate"), ("gnss", "out_of_order"), ("gnss", "disconnect"),
)  # fmt: skip
"""Every fault of a replayed sensor; over UDP a receiver that is unplugged is one that is silent. What else can befall
sensors is tested on a bench whose clock the tests move: own motion over CAN that stops or is damaged in
``test_own_motion.py``, PPS and GPS time against the host's in ``test_clock.py``, a camera of 60 Hz against a LiDAR of
10 in ``test_faults.py``, receivers over TCP and serial lines in ``test_loopback.py``."""
FIRST_S, EVERY_S, LASTS_S = 6.0, 1.4, 1.2
QUIET_S = 4.0
PAGE = os.sysconf("SC_PAGE_SIZE")
ALLOWED_SHARE, ALLOWED_BYTES = 0.02, 8e6
"""Of growth, in ten minutes; in half a minute, which has hardly a warm-up."""
CORES = 2
P99_MS, RECOVERY_S = 150.0, 1.0
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Networks:
    """Names or files, as the program takes them."""

    detector: str
    lanes: str


OURS = Networks(EMBEDDED, CLASSICAL)


def for_real_roads(lanes: str = OURS.lanes) -> Networks:
    """The setting for real roads and two cores, YOLOX-nano and lanes without a network, where its file is here, else
    what comes with the program. lanes: a file of ``models``. With TwinLiteNet, which takes both cores for 90 ms, every
    third result is 180 ms old: it needs more cores."""
    detector, network = data_dir() / "models" / "yolox_nano.onnx", data_dir() / "models" / lanes
    return Networks(
        str(detector) if detector.exists() else OURS.detector, str(network) if network.exists() else OURS.lanes
    )


@contextmanager
def on_two_cores() -> Iterator[list[int]]:
    """This thread and those that it starts. Gives the cores that are left for others, the same two where there are no
    more."""
    here = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, here[:CORES])
    try:
        yield here[CORES:] or here
    finally:
        os.sched_setaffinity(0, here)


def faults_for(seconds: float) -> list[Fault]:
    """One after the other, as often as they fit; the end is quiet."""
    count = int((seconds - FIRST_S - QUIET_S) / EVERY_S)
    return [
        Fault.model_validate(
            {"sensor": sensor, "kind": kind, "from_s": FIRST_S + k * EVERY_S, "to_s": FIRST_S + k * EVERY_S + LASTS_S}
        )
        for k in range(count)
        for sensor, kind in (KINDS[k % len(KINDS)],)
    ]


@dataclass
class Shown:
    """One frame as it was shown. at_s: when its result was ready, after the car's start."""

    at_s: float
    has: dict[str, bool]
    stages_ms: dict[str, float]
    lead_m: float | None


@dataclass
class Watcher:
    """Listens to the engine as the server does: encodes each frame, and keeps its figures."""

    start_ns: int = 0
    shown: list[Shown] = field(default_factory=list)
    errors: set[str] = field(default_factory=set)
    encoded_bytes: int = 0
    encoder: Encoder = field(default_factory=Encoder)
    _sequence: int = 0

    def __call__(self, snapshot: Snapshot) -> None:
        tick = snapshot.tick
        self.errors |= {notice.text for notice in snapshot.notices if notice.level == "error"}
        if tick is None or snapshot.sequence == self._sequence:
            return
        self._sequence = snapshot.sequence
        begun = time.perf_counter()
        self.encoded_bytes += len(self.encoder.message(snapshot) or b"")
        encode_ms = (time.perf_counter() - begun) * 1e3
        result, made_ns = tick.result, snapshot.made_unix_s * 1e9
        timing = result.timing_ms
        stages = {name: timing[name] for name in ("arrival", "waiting", "picture")}
        stages |= {"networks": tick.detect_ms, "line": timing["total"], "encode": encode_ms}
        stages["sensor to result"] = (made_ns - tick.frame.t_ns) / 1e6
        lead = result.cipv.distance_m if result.cipv is not None else None
        self.shown.append(Shown((made_ns - self.start_ns) / 1e9, _has(tick.frame), stages, lead))


def _has(frame: Frame) -> dict[str, bool]:
    return {"lidar": frame.sweep is not None, "camera": frame.picture is not None, "gnss": frame.gnss is not None}


class Memory:
    """Resident bytes of this process, every half second."""

    def __init__(self) -> None:
        self.samples: list[tuple[float, int]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample)
        self._thread.start()

    def _sample(self) -> None:
        while not self._stop.wait(0.5):
            resident = int(Path("/proc/self/statm").read_text().split()[1]) * PAGE
            self.samples.append((time.time(), resident))

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()

    def grown(self) -> tuple[float, float]:
        """Bytes from the second fifth to the last, and those of the second; medians, so that one frame more or less in
        the recorder's queue is no matter."""
        values = np.array([resident for _, resident in self.samples], dtype=np.float64)
        fifth = max(1, len(values) // 5)
        before, after = np.median(values[fifth : 2 * fifth]), np.median(values[-fifth:])
        return float(after - before), float(before)


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
    """Run it and measure."""
    with on_two_cores() as others:
        return _soak(folder, seconds, networks, others)


def _soak(folder: Path, seconds: float, networks: Networks, others: list[int]) -> dict[str, Any]:
    faults, config = faults_for(seconds), config_file(folder)
    faults_path = folder / "faults.yaml"
    faults_path.write_text(yaml.safe_dump([fault.model_dump() for fault in faults]), encoding="utf-8")
    watcher, desk = Watcher(), RecordingDesk(folder)
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
        desk=desk,
    )
    engine.listen(watcher)
    engine.start()
    engine.wait_for(lambda s: s.live, PATIENCE_S)
    command = [sys.executable, "-m", "tests.soak.live_car", str(config), str(seconds), str(faults_path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as car:
        os.sched_setaffinity(car.pid, others)
        watcher.start_ns = int(_line(car.stdout))
        engine.wait_for(lambda s: s.tick is not None, PATIENCE_S)
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
    return ran_with | _report(seconds, faults, watcher, memory, cpu_s, told, dropped, state)


def _report(
    seconds: float,
    faults: list[Fault],
    watcher: Watcher,
    memory: Memory,
    cpu_s: float,
    told: dict[str, Any],
    dropped: int,
    state: Any,
) -> dict[str, Any]:
    grown, resident = memory.grown()
    session = [SessionSource(str(file), str(file)) for file in state.files]
    recorded = sum(len(each) for each in session)
    pictures, sweeps = (
        sum(len(times) for each in session for of, times in each.file.log_times().items() if of.topic == topic)
        for topic in (IMAGE, POINTS)
    )
    taken = sum(_sweeps_taken(each) for each in session)
    for each in session:
        each.file.close()
    stages = {
        name: {
            "p50_ms": round(float(np.percentile([each.stages_ms[name] for each in watcher.shown], 50)), 2),
            "p99_ms": round(float(np.percentile([each.stages_ms[name] for each in watcher.shown], 99)), 2),
        }
        for name in watcher.shown[-1].stages_ms
    }
    recoveries = [
        {"sensor": fault.sensor, "kind": fault.kind, "seconds": _recovery_s(fault, watcher.shown)} for fault in faults
    ]
    return {
        "seconds": seconds,
        "frames": len(watcher.shown),
        "dropped_ticks": dropped,
        "stages": stages,
        "slowest_recovery_s": max(
            (np.inf if each["seconds"] is None else each["seconds"] for each in recoveries), default=0.0
        ),
        "recoveries": recoveries,
        "resident_MB": round(resident / 1e6, 1),
        "grown_MB": round(grown / 1e6, 2),
        "cores_used": round(cpu_s / seconds, 2),
        "recording": {
            "frames": state.frames,
            "pictures": pictures,
            "sweeps": sweeps,
            "sweeps_taken": taken,
            "dropped": state.dropped,
            "read_back": recorded,
            "error": state.error,
        },
        "shown_MB": round(watcher.encoded_bytes / 1e6, 1),
        "right_leads": _right_leads([each.lead_m for each in watcher.shown if each.at_s > seconds - QUIET_S + 2.0]),
        "errors": sorted(watcher.errors),
        "car": told,
    }


def _sweeps_taken(session: SessionSource) -> int:
    """How many sweeps came, at least: a frame's number counts the ticks before it that nobody took, too."""
    ticks = [tick_from(stored.data) for stored in session.file.messages((FRAMES,))][1:]  # the first was under way
    first = int(ticks[0].sweep is not None)
    return first + sum(int(b.name) - int(a.name) for a, b in pairwise(ticks) if b.sweep is not None)


def _right_leads(leads_m: list[float | None]) -> float:
    """Share of the quiet end's frames whose lead is where the car ahead is, within a metre."""
    low, high = live_car.LEAD_M
    right = [lead is not None and low - 1.0 < lead < high + 1.0 for lead in leads_m]
    return round(sum(right) / max(1, len(right)), 3)


def _recovery_s(fault: Fault, shown: list[Shown]) -> float | None:
    """From the fault's end to the first result that holds its sensor again; null when none did."""
    back = (each.at_s - fault.to_s for each in shown if each.at_s > fault.to_s and each.has[fault.sensor])
    return next((round(seconds, 3) for seconds in back), None)


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _line(stream: IO[str] | None) -> str:
    assert stream is not None
    line = stream.readline()
    assert line, "the car ended before it should"
    return line


def judge(report: dict[str, Any]) -> None:
    """What holds on any machine."""
    assert report["errors"] == []
    assert all(each["seconds"] is not None for each in report["recoveries"]), "every sensor came back"
    recording = report["recording"]
    assert (recording["dropped"], recording["error"]) == (0, None)
    assert recording["read_back"] == recording["frames"] > 0
    assert recording["pictures"] > 1.2 * recording["frames"], "thirty a second came, ten a second tick"
    assert recording["sweeps"] >= recording["sweeps_taken"], "of ticks that were dropped, too"
    assert report["right_leads"] > 0.5, "a busy machine misses sweeps, and a lead needs three in a row"


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident size is read from /proc")
def test_half_a_minute_with_every_fault(tmp_path: Path) -> None:
    report = soak(tmp_path, 30.0)
    print(json.dumps({name: value for name, value in report.items() if name != "recoveries"}))
    assert {(each["sensor"], each["kind"]) for each in report["recoveries"]} >= set(KINDS[:14])
    judge(report)
    assert report["grown_MB"] * 1e6 < ALLOWED_BYTES


@pytest.mark.soak
@pytest.mark.timeout(1200)
def test_ten_minutes_with_every_fault(tmp_path: Path) -> None:
    report = soak(tmp_path, 600.0, for_real_roads())
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / "soak_live.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({name: value for name, value in report.items() if name != "recoveries"}))
    judge(report)
    assert {(each["sensor"], each["kind"]) for each in report["recoveries"]} == set(KINDS)
    assert report["grown_MB"] < ALLOWED_SHARE * report["resident_MB"]
    assert report["right_leads"] > 0.95
    assert report["slowest_recovery_s"] <= RECOVERY_S
    assert report["stages"]["sensor to result"]["p99_ms"] < P99_MS
