"""Generates a fleet of short sessions for tests of batches and scores: random simulated traffic with sensor faults and
ground truth. No images are rendered; the sessions contain detections with a detector's errors."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from pipeline.common.progress import Progress, silent
from pipeline.experiments.robustness import traffic
from pipeline.experiments.robustness.road_kinds import layout_of
from pipeline.recording.session.provenance import About
from pipeline.recording.session.writer import SessionWriter
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.detection_model import BoxNoise, Detections, LineNoise
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.world import world_state
from pipeline.sources.simulated import truth_of

_SEED = 7
_DETECTIONS = Detections(boxes=BoxNoise(), lines=LineNoise())


def make_sessions(folder: Path, count: int, seconds: float = 20.0, progress: Progress = silent) -> list[Path]:
    """Write ``count`` sessions, each a part of a different drive. The roads are straight, so that the lead follows from
    the recording's labels. progress: counts sessions."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for done, number in enumerate(islice(_straight(), count)):
        file = folder / f"drive-{number:05d}.mcap"
        files.append(file)
        if not file.exists():
            _write(file, number, seconds)
        progress(done + 1, count)
    return files


def _straight() -> Iterator[int]:
    """Yield the numbers of drives without bends and crossings, in order."""
    number = 0
    while True:
        _, layout, _ = layout_of(_SEED, number)
        if not layout.bends and not layout.crossing:
            yield number
        number += 1


def _write(file: Path, number: int, seconds: float) -> None:
    scene: Scenario = traffic.scenario(_SEED, number).model_copy(update={"detections": _DETECTIONS})
    frames = min(round(seconds * scene.rate_hz), scene.frame_count())
    begin = int(np.random.default_rng([_SEED, number, 1]).integers(0, scene.frame_count() - frames + 1))
    sensors = SensorRig(scene, world_state.at(scene, scene.duration_s).s_m)
    senses, step_ns = Senses(scene), round(1e9 / scene.rate_hz)
    writer = SessionWriter(file, About(f"traffic {number}", f"Traffic {number}", scene.rate_hz, ()))
    try:
        for index in range(begin, begin + frames):
            now = world_state.at(scene, index / scene.rate_hz)
            frame = senses.sensed(sensors.frame(now, index, index * step_ns, image=False), now)
            writer.write(frame, truth=truth_of(now, scene.road))
        writer.close()
    except BaseException:
        writer.discard()
        raise
