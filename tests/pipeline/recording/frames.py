"""Small frames with everything that a frame can contain, and their comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.params import Params
from pipeline.recording.session.provenance import About
from pipeline.recording.session.writer import SessionWriter
from pipeline.types import (
    CameraCalibration,
    CameraImage,
    EgoState,
    Frame,
    GnssFix,
    RangeScan,
    Route,
    StreamHealth,
    Sweep,
)
from pipeline.types.source import TruthObject

PERIOD_NS = 100_000_000
ABOUT = About("test:drive", "A test drive", 10.0, ("made for a test",))
CAMERA = CameraCalibration(
    np.array([[30.0, 0.0, 16.0], [0.0, 30.0, 12.0], [0.0, 0.0, 1.0]]),
    np.array([0.1, -0.2, 0.001, 0.002, 0.03]),
    np.array([[0.0, -1.0, 0.0, 0.1], [0.0, 0.0, -1.0, 0.6], [1.0, 0.0, 0.0, -0.3], [0.0, 0.0, 0.0, 1.0]]),
    32,
    24,
    road_z_m=-0.62,
)
ROUTE = Route("to work", np.array([50.1, 50.2, 50.30001]), np.array([8.1, 8.2, 8.3]), 0.5)
TRUTH = (TruthObject("car", Cuboid((20.0, 0.1, 0.3), (4.0, 1.8, 1.5), 0.01), 7),)


def sweep(index: int = 0, points: int = 40, t_ns: int | None = None) -> Sweep:
    """A random 16-channel sweep, the same for the same index."""
    random = np.random.default_rng(index)
    xyzi = random.normal(0.0, 20.0, (points, 4)).astype(np.float32)
    ring = random.integers(0, 16, points).astype(np.uint8)
    return Sweep(PERIOD_NS * (1 + index) if t_ns is None else t_ns, xyzi, ring, 16)


def image(index: int = 0, kind: str = ".jpg", t_ns: int | None = None) -> CameraImage:
    """An image of noise, the same for the same index. Only a JPEG has its encoded form."""
    bgr = np.random.default_rng(index).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    if kind != ".jpg":
        return CameraImage(t_ns, bgr)
    encoded = cv2.imencode(kind, bgr)[1].tobytes()
    decoded = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR)
    return CameraImage(t_ns, np.asarray(decoded, np.uint8), encoded)


def scan(index: int, t_ns: int) -> RangeScan:
    """A random scan of a sensor that this program does not know, the same for the same index."""
    random = np.random.default_rng(index)
    points = random.normal(0.0, 50.0, (3, 3)).astype(np.float32)
    return RangeScan(t_ns - 5, points, {"range_rate_mps": random.normal(0.0, 9.0, 3).astype(np.float32)})


def full(index: int) -> Frame:
    t_ns = PERIOD_NS * (1 + index)
    return Frame(
        index,
        f"{index:06d}",
        t_ns,
        sweep=replace(sweep(index), time_s=np.linspace(-0.05, 0.05, 40).astype(np.float32)),
        image=image(index, t_ns=t_ns - 7_000_001),
        camera=CAMERA,
        ego=EgoState(t_ns - 3, 20.0 + index / 3.0, -0.01),
        notes=("gnss silent for 1.0 s (antenna?)",),
        gnss=GnssFix(t_ns, 50.123456789012, 8.1 + index / 7.0, 111.0, 1.2345, 20.1, "rtk_fixed", 0.02),
        route=ROUTE,
        streams=(StreamHealth("camera", "stale", 29.97, 12.5, 1.0, 3, "cable?"),),
        timing_ms={"arrival": 12.25},
        scans={"sonar": scan(index, t_ns)},
    )


def write(path: Path, frames: list[Frame], params: Params | None = None, result: dict[str, Any] | None = None) -> Path:
    """Write a finished session of these frames."""
    writer = SessionWriter(path, ABOUT)
    for frame in frames:
        writer.write(frame, result, params, truth=TRUTH)
    writer.close()
    return path


def same(a: object, b: object) -> bool:
    """Whether both are equal in every bit, including nested values and arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        equal = isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape
        return equal and a.tobytes() == b.tobytes()
    if is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return type(a) is type(b) and a == b
