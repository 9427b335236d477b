"""What each rule against false leads brings on the real recordings: each is switched off in turn.

    CIPV_DATA=… python -m tests.soak.ablation [--only "no size gate,wide camera gate"] [--sensors camera]

YOLOX-nano, its far view and TwinLiteNet; KITTI reduced to 16 rings. The networks run once, the
pipeline once for each variant of the robustness suite (``cipv scenarios run --suite robustness --ablation`` counts the
same variants in random traffic). Prints a row of a Markdown table for each.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import NamedTuple

from pipeline.common.files.data_dir import data_dir
from pipeline.detection import Detectors, camera_of, detector_for, far_lanes_for, far_view_for, lanes_for
from pipeline.evaluation.lead_verdict import Judged, judge
from pipeline.experiments.robustness.experiment import AS_IS, VARIANTS
from pipeline.lanes.open_detector import usual_every
from pipeline.params import Params, with_changes
from pipeline.run import Sensors, sensed
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import Frame, Result
from pipeline.types.source import TruthObject
from pipeline.warm_up import warm_up
from tests.accuracy.drives import EMPTY_CLIP, FOLDERS, RULE, SCHEMES, SCORED_CLIPS

FAR_M = 60.0
HEAD = (
    "| switched off | 0009: lead nearer than 60 m | braking | 0052: lead | ids | Astyx: correct | missed | wrong "
    "| largest error | false leads | other leads or commands |\n" + "|---" * 11 + "|"
)
_SAME_MPS2 = 0.01


class Seen(NamedTuple):
    """A recording after the networks."""

    frames: list[Frame]
    truths: list[tuple[TruthObject, ...] | None]
    """Labels of each frame; None without any."""


def opened(kind: str, sensors: Sensors) -> Seen:
    """A recording of the data folder after the networks, as a car with these sensors has it."""
    source = open_source(f"{SCHEMES[kind]}:{data_dir() / FOLDERS[kind]}")
    network = detector_for(source, str(data_dir() / "models/yolox_nano.onnx"))
    lanes = lanes_for(source, "twinlitenet")
    every = usual_every(lanes, source.rate_hz)
    far = far_view_for(source, network)
    detectors = Detectors(network, lanes, every, far, far_lanes=far_lanes_for(camera_of(source), lanes))
    indices = range(len(source))
    return Seen(
        [sensed(source.frame(index), detectors, sensors) for index in indices], [source.truth(i) for i in indices]
    )


def results(seen: Seen, params: Params) -> list[Result]:
    """The results of every frame, in order."""
    state, found = State(), []
    for frame in seen.frames:
        state, result = step(state, frame, params)
        found.append(result)
    return found


def row(recordings: Mapping[str, Seen], found: Mapping[str, list[Result]], before: Mapping[str, list[Result]]) -> str:
    """Cells of one variant. before: the results without a change."""
    street = found["street"]
    near = sum(each.cipv is not None and each.cipv.distance_m < FAR_M for each in street)
    braking = sum(each.acc is not None and each.acc.brake > 0.0 for each in street)
    leads = [each.cipv.id for each in found["kitti"] if each.cipv is not None]
    judged = scored(recordings["astyx"], found["astyx"])
    verdicts = [each.verdict for each in judged]
    errors = [abs(each.error_m) for each in judged if each.error_m is not None]
    empty = {f"{number:06d}" for number in EMPTY_CLIP}
    invented = [
        result.cipv.distance_m <= FAR_M
        for frame, result in zip(recordings["astyx"].frames, found["astyx"], strict=True)
        if frame.name in empty and result.cipv is not None
    ]
    differ = sum(not _is_same(a, b) for kind in found for a, b in zip(found[kind], before[kind], strict=True))
    cells = (
        near,
        braking,
        len(leads),
        len(set(leads)),
        *(verdicts.count(name) for name in ("correct", "missed", "wrong")),
        f"{max(errors, default=0.0):.2f} m",
        sum(invented),
        differ,
    )
    return " | ".join(map(str, cells))


def scored(seen: Seen, found: list[Result]) -> list[Judged]:
    """The verdicts of the scored Astyx frames."""
    names = {f"{number:06d}" for clip in SCORED_CLIPS.values() for number in clip}
    rows = zip(seen.frames, seen.truths, found, strict=True)
    return [judge(result, truth, RULE) for frame, truth, result in rows if frame.name in names and truth is not None]


def _is_same(one: Result, other: Result) -> bool:
    """Whether two results have the same lead at the same distance and the same acceleration. Ids may differ."""
    leads = one.cipv and one.cipv.distance_m, other.cipv and other.cipv.distance_m
    a, b = (each.acc.accel_mps2 if each.acc is not None else 0.0 for each in (one, other))
    return leads[0] == leads[1] and abs(a - b) < _SAME_MPS2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--sensors", default="both", choices=["both", "camera", "lidar"])
    asked = parser.parse_args()
    only = [name for name in asked.only.split(",") if name]
    warm_up()
    recordings = {kind: opened(kind, asked.sensors) for kind in ("street", "kitti", "astyx")}
    before = {kind: results(seen, Params()) for kind, seen in recordings.items()}
    print(HEAD)
    print(f"| {AS_IS} | {row(recordings, before, before)} |", flush=True)
    for name, changes in VARIANTS.items():
        if name != AS_IS and (name in only or not only):
            params = with_changes(Params(), changes)
            found = {kind: results(seen, params) for kind, seen in recordings.items()}
            print(f"| {name} | {row(recordings, found, before)} |", flush=True)


if __name__ == "__main__":
    main()
