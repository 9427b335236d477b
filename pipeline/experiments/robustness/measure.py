"""Measure a detector's errors on labelled recordings, for the simulator's ``measured_noise.json``.

    python -m pipeline.experiments.robustness.measure astyx:DIR kitti:DIR=LABELS.txt --detector yolox_nano.onnx

A recording's own labels are taken unless a file in KITTI's tracking form is named after ``=``.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan2, degrees, hypot, log
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.alignment.projection import Pinhole, project_cuboids
from pipeline.common.geometry import corners_of, iou_matrix
from pipeline.detection import detector_for
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.kitti.files import read_tracking
from pipeline.labels.model import Origin
from pipeline.params import DetectionParams
from pipeline.simulation.sensors.measured_noise import FILE, SHARES, FalseBoxes, MeasuredNoise
from pipeline.simulation.sensors.truth_boxes import visible_share
from pipeline.sources import open_source
from pipeline.types import F64, VEHICLES, Box, CameraCalibration, Detection
from pipeline.types.source import Source, TruthObject
from pipeline.vision.nms import select

RANGES_M = (0.0, 15.0, 25.0, 35.0, 45.0, 60.0, 80.0)
VISIBLE = (1.0, 0.8, 0.4, 0.1)
_FOCAL_PX = 907.0
_SAME, _DOUBLE, _FALSE = 0.4, 0.25, 0.15
"""Overlap from which a box is of a vehicle, from which a second one is of it too, and below which it is of none."""
_LARGE = ("truck", "bus")
_STEP_S = 0.15
"""Frames that follow each other faster than this show what lasts from frame to frame."""
_FEWEST_PX = 10.0
"""Lower vehicles are not asked for: labels hold cars of 5 px that no network finds."""


@dataclass
class Seen:
    """One labelled vehicle in one frame. track: None without an identity; offs: of each edge, share of the height."""

    recording: int
    frame: int
    t_s: float
    track: int | None
    label: str
    range_m: float
    visible: float
    found: Detection | None
    offs: F64 | None
    height_px: float
    doubled: bool


@dataclass
class Counted:
    """All that was seen, and each frame's false boxes: (recording, t_s, box at 907 px, bearing, score)."""

    seen: list[Seen] = field(default_factory=list)
    false: list[tuple[int, float, Box, float, float]] = field(default_factory=list)
    frames: int = 0


def truths(source: Source, labels: str) -> Iterator[tuple[TruthObject, ...] | None]:
    """Each frame's labelled objects; None for a frame without labels."""
    if not labels:
        yield from (source.truth(index) for index in range(len(source)))
        return
    tracks = read_tracking(Path(labels), drive_of(source), Origin("import", labels, 0)).labels.tracks
    for index in range(len(source)):
        sightings = [(track, track.at(index)) for track in tracks]
        yield tuple(
            TruthObject(track.label, each.cuboid, track.id)
            for track, each in sightings
            if each is not None and each.cuboid is not None
        )


def left_out(labels: str) -> dict[int, list[Box]]:
    """By frame, the parts of the image that KITTI's labellers left out: what is there is neither true nor false."""
    found: dict[int, list[Box]] = {}
    for line in Path(labels).read_text(encoding="utf-8").splitlines() if labels else ():
        frame, _, kind, _, _, _, x1, y1, x2, y2, *_ = line.split()
        if kind == "DontCare":
            found.setdefault(int(frame), []).append((float(x1), float(y1), float(x2), float(y2)))
    return found


def _is_left_out(box: Box, parts: Sequence[Box]) -> bool:
    """Whether half of a box lies in such a part."""
    area = (box[2] - box[0]) * (box[3] - box[1])
    return any(
        max(min(box[2], x2) - max(box[0], x1), 0.0) * max(min(box[3], y2) - max(box[1], y1), 0.0) > area / 2
        for x1, y1, x2, y2 in parts
    )


def count(recording: int, source: Source, labels: str, detector: str | None, into: Counted) -> None:
    """Look at every labelled frame of a recording."""
    look, parts = detector_for(source, detector), left_out(labels)
    for index, truth in enumerate(truths(source, labels)):
        frame = source.frame(index)
        if truth is None or frame.picture is None or frame.camera is None:
            continue
        into.frames += 1
        boxes = select(look.detect(frame.picture.bgr), DetectionParams())
        ignored = parts.get(index, ())
        vehicles = tuple(box for box in boxes if box.label in VEHICLES and not _is_left_out(box.bbox, ignored))
        _compare(recording, index, frame.t_ns / 1e9, truth, vehicles, frame.camera, into)


def _compare(
    recording: int,
    index: int,
    t_s: float,
    truth: tuple[TruthObject, ...],
    boxes: tuple[Detection, ...],
    camera: CameraCalibration,
    into: Counted,
) -> None:
    items = sorted((item for item in truth if item.cuboid.center[0] > 2.0), key=lambda item: item.cuboid.center[0])
    view = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    places = project_cuboids(view, corners_of([item.cuboid for item in items]), camera.width, camera.height)
    known = [(item, place) for item, place in zip(items, places, strict=True) if place is not None]
    detected = np.array([box.bbox for box in boxes]).reshape(-1, 4)
    overlap = iou_matrix(np.array([place for _, place in known]).reshape(-1, 4), detected)
    for n, (item, place) in enumerate(known):
        height = place[3] - place[1]
        cut = place[0] <= 1.0 or place[2] >= camera.width - 1.0 or place[3] >= camera.height - 1.0
        if item.label not in VEHICLES or cut or height < _FEWEST_PX:
            continue
        best = int(overlap[n].argmax()) if len(boxes) else -1
        is_found = best >= 0 and overlap[n, best] >= _SAME and int(overlap[:, best].argmax()) == n
        box = boxes[best] if is_found else None
        others = [k for k in range(len(boxes)) if k != best and overlap[n, k] > _DOUBLE]
        doubled = any(int(overlap[:, k].argmax()) == n and overlap[:, k].max() < _SAME for k in others)
        offs = (np.array(box.bbox) - place) / height if box is not None else None
        away_m = hypot(*item.cuboid.center[:2]) - item.cuboid.size[0] / 2
        share = visible_share(place, [other for _, other in known[:n]])
        into.seen.append(
            Seen(recording, index, t_s, item.id, item.label, away_m, share, box, offs, height, is_found and doubled)
        )
    scale = _FOCAL_PX / float(camera.K[0, 0])
    for k, box in enumerate(boxes):
        if not len(known) or overlap[:, k].max() < _FALSE:
            x1, y1, x2, y2 = (float(edge) * scale for edge in box.bbox)
            bearing = degrees(atan2((x1 + x2) / 2 / scale - camera.K[0, 2], camera.K[0, 0]))
            into.false.append((recording, t_s, (x1, y1, x2, y2), abs(bearing), box.score))


def summed_up(counted: Counted, measured_on: Sequence[str]) -> MeasuredNoise:
    """The model's numbers. Of edges, what is the same in all boxes (a cuboid's projection is larger than its image)
    is taken off first."""
    bins = [_between(counted.seen, low, high) for low, high in pairwise(RANGES_M)]
    found = tuple(
        tuple(_share_found([s for s in each if low < s.visible <= high]) for each in bins)
        for high, low in pairwise(VISIBLE)
    )
    clear = [seen for seen in counted.seen if seen.visible > VISIBLE[1] and seen.offs is not None]
    offs = np.array([seen.offs for seen in clear])
    white = _white(clear)
    lasting = np.sqrt(np.maximum(_spread(offs) ** 2 - white**2, 0.0))
    return MeasuredNoise(
        measured_on=tuple(measured_on),
        ranges_m=RANGES_M,
        vehicles=tuple(sum(seen.visible > VISIBLE[1] for seen in each) for each in bins),
        visible=VISIBLE,
        found=found,
        missed_again=_missed_again(counted.seen),
        across_share=round(float(lasting[[0, 2]].mean()), 4),
        up_share=round(float(lasting[[1, 3]].mean()), 4),
        frame_share=round(float(white.mean()), 4),
        frame_px=round(_white_px(clear), 2),
        score=tuple(_quantiles([s.found.score for s in each if s.found is not None]) for each in bins),
        car_called=_called([seen for seen in clear if seen.label not in (*_LARGE, "motorcycle")], "car"),
        large_called=_called([seen for seen in clear if seen.label in _LARGE], "truck"),
        doubled=round(float(np.mean([seen.doubled for seen in clear])), 4),
        false_boxes=_false(counted),
    )


def _between(seen: Sequence[Seen], low: float, high: float) -> list[Seen]:
    return [each for each in seen if low <= each.range_m < high]


def _share_found(seen: Sequence[Seen]) -> float:
    """With half a vehicle found and half a vehicle missed added, so that no share is 0 or 1 by chance (Jeffreys)."""
    return round((sum(each.found is not None for each in seen) + 0.5) / (len(seen) + 1.0), 3)


def _spread(values: F64) -> F64:
    """Standard deviation of each column, by the quartiles: a few boxes that took in two vehicles do not count."""
    low, high = np.percentile(values, [25, 75], axis=0)
    spread: F64 = (high - low) / 1.349
    return spread


def _followed(seen: Sequence[Seen]) -> Iterator[tuple[Seen, Seen]]:
    """The same vehicle in two frames that follow each other."""
    by_key = {(each.recording, each.track, each.frame): each for each in seen if each.track is not None}
    for (recording, track, frame), now in by_key.items():
        after = by_key.get((recording, track, frame + 1))
        if after is not None and 0.0 < after.t_s - now.t_s < _STEP_S:
            yield now, after


def _white(seen: Sequence[Seen]) -> F64:
    steps = [b.offs - a.offs for a, b in _followed(seen) if a.offs is not None and b.offs is not None]
    return _spread(np.array(steps)) / np.sqrt(2.0) if len(steps) > 20 else np.full(4, 0.03)


def _white_px(seen: Sequence[Seen]) -> float:
    """Of the vehicles that are lowest in the image, where pixels count and not shares."""
    low = sorted(_followed(seen), key=lambda pair: pair[0].height_px)
    low = low[: max(len(low) // 3, 1)]
    steps = [(b.offs - a.offs) * a.height_px for a, b in low if a.offs is not None and b.offs is not None]
    return float(_spread(np.array(steps)).mean() / np.sqrt(2.0)) if len(steps) > 20 else 0.7


def _missed_again(seen: Sequence[Seen]) -> float:
    """Correlation of being missed in two frames that follow each other, of all vehicles that are partly in sight."""
    pairs = [(a.found is None, b.found is None) for a, b in _followed(seen) if a.visible > VISIBLE[2]]
    return round(float(np.clip(np.corrcoef(np.array(pairs, dtype=float).T)[0, 1], 0.0, 0.98)), 3)


def _quantiles(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(float(value), 3) for value in np.quantile(values or [0.5], SHARES))


def _called(seen: Sequence[Seen], own: str) -> dict[str, float]:
    names = Counter(each.found.label for each in seen if each.found is not None)
    total = max(sum(names.values()), 1)
    return {name: round(n / total, 4) for name, n in sorted(names.items()) if name not in (own, "motorcycle")}


def _false(counted: Counted) -> FalseBoxes:
    false = counted.false
    again, grown, could = 0, [], 0
    times: dict[int, set[float]] = {}
    for seen in counted.seen:
        times.setdefault(seen.recording, set()).add(seen.t_s)
    for recording, t_s, box, _, _ in false:
        later = [t for t in sorted(times[recording]) if 0.0 < t - t_s < _STEP_S]
        if not later:
            continue
        could += 1
        next_boxes = [other for r, t, other, _, _ in false if r == recording and t == later[0]]
        overlap = iou_matrix(np.array([box]), np.array(next_boxes).reshape(-1, 4))[0]
        if len(overlap) and overlap.max() > _DOUBLE:
            again += 1
            best = next_boxes[int(overlap.argmax())]
            grown.append(log((best[3] - best[1]) / (box[3] - box[1])))
    return FalseBoxes(
        per_frame=round(len(false) / counted.frames, 3),
        lasts=round(again / max(could, 1), 3),
        seen=tuple(
            (
                round(box[3] - box[1], 1),
                round((box[2] - box[0]) / (box[3] - box[1]), 2),
                round(bearing, 1),
                round(score, 2),
            )
            for _, _, box, bearing, score in sorted(false, key=lambda each: each[2][3] - each[2][1])
        ),
        height_share=round(float(_spread(np.array(grown))), 3) if len(grown) > 5 else 0.1,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", metavar="URI[=LABELS]")
    parser.add_argument("--detector", help="name or file; the default network without")
    parser.add_argument("--out", type=Path, default=FILE)
    asked: Any = parser.parse_args(arguments)
    counted, names = Counted(), []
    for n, each in enumerate(asked.recordings):
        uri, _, labels = each.partition("=")
        before = counted.frames
        count(n, open_source(uri), labels, asked.detector, counted)
        names.append(f"{Path(uri).name}: {counted.frames - before} labelled frames")
    detector = Path(asked.detector).stem if asked.detector else "default network"
    noise = summed_up(counted, (*names, f"detector: {detector}"))
    asked.out.write_text(json.dumps(noise.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
