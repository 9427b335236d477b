"""A recording in memory: a car 30 m ahead on a flat road, which comes 0.4 m nearer with each frame."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import cv2
import numpy as np

from pipeline.common.progress import Progress, silent
from pipeline.inference.cancellation import Stopped, of_this_thread
from pipeline.types import F32, U8, CameraCalibration, CameraImage, EgoState, Frame, RawBoxes, RawLanes, Sweep
from pipeline.types.source import SourceError, TruthObject

WIDTH, HEIGHT = 320, 180
FOCAL_PX = 250.0
GROUND_M = -0.6
NEAREST_M = 2.0
PERIOD_NS = 100_000_000
HANGS_S = 600.0
"""A hung disk hangs for longer than any test waits, even on a busy machine."""


@dataclass
class CountingDetector:
    """Detects the drawn car and counts its calls."""

    name: str = "counting"
    notes: tuple[str, ...] = ()
    calls: int = 0

    def detect(self, bgr: U8) -> RawBoxes:
        self.calls += 1
        rows, columns = np.nonzero((bgr[:, :, 2] > 150) & (bgr[:, :, 0] < 60))
        box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        return RawBoxes(self.name, np.array([box], np.float32), np.array([0.8], np.float32), ("car",))


class CountingLanes:
    """Detects no lane lines and counts its calls."""

    name, notes = "counting lanes", ()

    def __init__(self) -> None:
        self.calls = 0

    def detect(self, bgr: U8) -> RawLanes:
        self.calls += 1
        return RawLanes(self.name, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


class Options:
    """Options of a network's run."""

    terminate = False


@dataclass
class SlowDetector(CountingDetector):
    """A network whose ``slow_at``-th call does not return until it is stopped; later calls are fast. ``slow``: set
    during that call. ``stopped``: how often it was stopped."""

    slow_at: int = 0
    slow: threading.Event = field(default_factory=threading.Event)
    stopped: int = 0

    def detect(self, bgr: U8) -> RawBoxes:
        found, options = super().detect(bgr), Options()
        with of_this_thread().ends(options):
            while self.calls == self.slow_at and not options.terminate:
                self.slow.set()
        if options.terminate:
            self.stopped += 1
            raise Stopped
        return found


class Recording:
    """``gate``: while it is cleared, reading a frame waits. ``reading``: set when reading begins. ``broken``: frames
    that cannot be read."""

    rate_hz = 10.0

    def __init__(self, uri: str = "test:car", count: int = 30, broken: frozenset[int] = frozenset()) -> None:
        self.uri, self.title, self.notes = uri, "a car", ("made for a test",)
        self.is_simulated = uri.startswith("sim:")
        self.reads: list[int] = []
        self.reading = threading.Event()
        self.gate = threading.Event()
        self.gate.set()
        self._count, self._broken = count, broken

    def __len__(self) -> int:
        return self._count

    def t_ns(self, index: int) -> int:
        return PERIOD_NS * (1 + index)

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        return None

    def frame(self, index: int) -> Frame:
        self.reads.append(index)
        self.reading.set()
        assert self.gate.wait(HANGS_S)
        if index in self._broken:
            raise OSError(f"frame {index} is not there")
        distance_m = max(30.0 - 0.4 * index, NEAREST_M)  # it comes nearer, then stands still before the car
        t_ns = self.t_ns(index)
        points, ring = _points(distance_m)
        return Frame(
            index=index,
            name=f"{index:06d}",
            t_ns=t_ns,
            sweep=Sweep(t_ns, points, ring, 16),
            image=_image(t_ns, distance_m),
            camera=_camera(),
            ego=EgoState(t_ns, 20.0, 0.0),
        )


def opener(*recordings: Recording):
    """An ``open_source`` that opens these recordings."""
    known = {recording.uri: recording for recording in recordings}

    def open_source(uri: str, *, progress: Progress = silent) -> Recording:
        if uri not in known:
            raise SourceError(f"{uri}: no such recording")
        return known[uri]

    return open_source


def _camera() -> CameraCalibration:
    K = np.array([[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1.0]])
    T = np.array([[0, -1, 0, 0], [0, 0, -1, 0.6], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    return CameraCalibration(K, np.zeros(0), T, WIDTH, HEIGHT)


def _points(distance_m: float) -> tuple[F32, U8]:
    """A grid of ground points, and points on the car's rear, 1.6 m wide and 1.2 m high."""
    x, y = np.meshgrid(np.arange(2.0, 40.0, 0.5), np.arange(-6.0, 6.01, 0.5))
    ground = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, GROUND_M)])
    across, up = np.meshgrid(np.linspace(-0.8, 0.8, 9), np.linspace(GROUND_M + 0.4, GROUND_M + 1.3, 6))
    rear = np.column_stack([np.full(across.size, distance_m), across.ravel(), up.ravel()])
    xyz = np.vstack([ground, rear])
    points = np.column_stack([xyz, np.full(len(xyz), 20.0)]).astype(np.float32)
    return points, np.zeros(len(points), np.uint8)


def _image(t_ns: int, distance_m: float) -> CameraImage:
    """A red car on grey, as the camera sees it, as a JPEG."""
    bgr = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    left, right = (round(WIDTH / 2 + FOCAL_PX * y / distance_m) for y in (-0.8, 0.8))
    top, bottom = (round(HEIGHT / 2 - FOCAL_PX * (z - 0.6) / distance_m) for z in (0.8, -0.5))
    cv2.rectangle(bgr, (left, top), (right, bottom), (20, 20, 220), cv2.FILLED)
    encoded = cv2.imencode(".jpg", bgr)[1].tobytes()
    return CameraImage(t_ns, bgr, encoded)
