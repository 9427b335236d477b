"""All benchmarks of `cipv bench`, on real sweeps where available and otherwise on simulated ones."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from app.bench import detector as detector_bench
from app.bench import lidar as lidar_bench
from app.bench import packets as packets_bench
from app.bench import simulation as simulation_bench
from app.bench import whole_pipeline as pipeline_bench
from app.bench.calibration import Calibration
from app.web.source_catalog import recordings
from pipeline.detection import Detectors, camera_of, detector_for, far_lanes_for, far_view_for, lanes_for
from pipeline.inference.runtime import DetectorMissing
from pipeline.lanes.open_detector import usual_every
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import Sweep
from pipeline.types.source import Source
from pipeline.vision.detector import Detector

BUDGET_S = {"decode": 1.5, "lidar": 8.0, "lidar@kitti": 6.5, "line": 10.0, "detector": 4.0, "simulation": 3.0}
"""Wall time of each part; together with loading and compiling they stay below 45 s."""
FRAMES = 40
CALIBRATION = "calibration"
SWEEPS_HZ = 10.0
"""Frame rate of a VLP-16. A recording may have fewer frames per second (Astyx 3.3), but the pipeline must keep up with
the sensor, so the lane network runs as often as it would then."""


def run_all(params: Params, detector_spec: str | None) -> dict[str, dict[str, Any]]:
    """The object of docs/reference/results.md: stage → median_ms, p99_ms and peers with their ratios, and under
    ``CALIBRATION`` a fixed loop that was measured between them (``app.bench.calibration``).

    Where a KITTI drive is available, the LiDAR stages are repeated as ``stage@kitti``: its sweeps, reduced to the rings
    of a VLP-16, are twice as dense."""
    source = _source()
    print(f"cipv: measuring on {source.title}", file=sys.stderr)
    frames = [source.frame(i) for i in range(min(FRAMES, len(source)))]
    network, lanes = _detector(detector_spec, source), lanes_for(source)
    far = far_view_for(source, network)
    every = usual_every(lanes, SWEEPS_HZ)
    looking = Detectors(network, lanes, every, far, far_lanes=far_lanes_for(camera_of(source), lanes))
    parts: list[Callable[[], dict[str, dict[str, Any]]]] = [
        lambda: packets_bench.stages(BUDGET_S["decode"]),
        lambda: lidar_bench.stages(_sweeps(source), BUDGET_S["lidar"], params),
        lambda: _dense_sweeps(params),
        lambda: pipeline_bench.stages(source, len(frames), params, looking, BUDGET_S["line"]),
        lambda: detector_bench.stages(frames, network, BUDGET_S["detector"], far) if network is not None else {},
        lambda: simulation_bench.stages(BUDGET_S["simulation"]),
    ]
    figures: dict[str, dict[str, Any]] = {}
    calibration = Calibration()
    for part in parts:
        figures |= part()
        calibration.sample()
    return figures | {CALIBRATION: calibration.row()}


def _source() -> Source:
    """The first real 16-channel recording; without one, the simulator."""
    return _recording("astyx:") or open_source("sim:straight")


def _recording(scheme: str) -> Source | None:
    return next((open_source(uri) for uri, _ in recordings() if uri.startswith(scheme)), None)


def _sweeps(source: Source) -> list[Sweep]:
    frames = (source.frame(i) for i in range(min(FRAMES, len(source))))
    return [frame.sweep for frame in frames if frame.sweep is not None]


def _dense_sweeps(params: Params) -> dict[str, dict[str, Any]]:
    kitti = _recording("kitti:")
    if kitti is None:
        return {}
    rows = lidar_bench.stages(_sweeps(kitti), BUDGET_S["lidar@kitti"], params)
    return {f"{stage}@kitti": row for stage, row in rows.items()}


def _detector(spec: str | None, source: Source) -> Detector | None:
    try:
        return detector_for(source, spec)
    except DetectorMissing as missing:
        if spec is not None:
            raise
        print(f"cipv: {missing}", file=sys.stderr)
        return None
