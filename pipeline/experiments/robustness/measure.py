"""Measure a detector's errors on labelled recordings, for the simulator's ``measured_noise.json``.

    python -m pipeline.experiments.robustness.measure astyx:DIR kitti:DIR=LABELS.txt --detector yolox_nano.onnx \
        --second deimv2_femto.onnx

A recording's own labels are taken unless a file in KITTI's tracking form is named after ``=``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from math import atan2, degrees, hypot
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pipeline.alignment.projection import Pinhole, project_cuboids
from pipeline.common.geometry import corners_of, iou_matrix
from pipeline.detection import Detectors, detect, detector_for, far_view_for
from pipeline.experiments.robustness.detector_noise import DOUBLE, Counted, JudgedVehicle, summed_up
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.kitti.files import read_tracking
from pipeline.labels.model import Origin
from pipeline.params import DetectionParams
from pipeline.simulation.sensors.measured_noise import FILE
from pipeline.simulation.sensors.truth_boxes import visible_part
from pipeline.sources import open_source
from pipeline.types import VEHICLES, Box, CameraCalibration, Detection, Frame
from pipeline.types.source import Source, TruthObject
from pipeline.vision.nms import select

_FOCAL_PX = 907.0
_SAME, _FALSE = 0.4, 0.15
"""Overlap above which a box belongs to a vehicle, and below which it is false."""
_CONFIRMED = 0.5
"""Overlap above which two networks mean the same vehicle."""
_FEWEST_PX = 10.0
"""Vehicles of smaller height are ignored: some labelled cars are 5 px high, which no network finds."""


class MeasuredNetworks(NamedTuple):
    """The networks that are measured and compared."""

    detector: str | None
    """Name or file of the one that is measured; None for the default."""
    looks_far: bool
    """Whether it also processes the far view, as in the pipeline."""
    second: str | None
    """One of another family. What both call a vehicle is no false box, although nobody labelled it: of 60 boxes of
    YOLOX-nano with scores above 0.5 on Astyx and KITTI that belong to no labelled vehicle, about 36 show one, as seen
    by eye. DEIMv2-femto confirms 20 of these, and 2 of the other 24."""


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
    """By frame, the image regions that KITTI's labelers left out; boxes there are neither true nor false."""
    found: dict[int, list[Box]] = {}
    for line in Path(labels).read_text(encoding="utf-8").splitlines() if labels else ():
        frame, _, kind, _, _, _, x1, y1, x2, y2, *_ = line.split()
        if kind == "DontCare":
            found.setdefault(int(frame), []).append((float(x1), float(y1), float(x2), float(y2)))
    return found


def _is_left_out(box: Box, parts: Sequence[Box]) -> bool:
    """Whether at least half of a box lies in such a region."""
    area = (box[2] - box[0]) * (box[3] - box[1])
    return any(
        max(min(box[2], x2) - max(box[0], x1), 0.0) * max(min(box[3], y2) - max(box[1], y1), 0.0) > area / 2
        for x1, y1, x2, y2 in parts
    )


def count(recording: int, source: Source, labels: str, networks: MeasuredNetworks, into: Counted) -> None:
    """Process every labelled frame of a recording."""
    parts = left_out(labels)
    detectors = _opened(networks.detector, source, networks.looks_far)
    second = _opened(networks.second, source, True) if networks.second is not None else None
    for index, truth in enumerate(truths(source, labels)):
        frame = source.frame(index)
        if truth is None or frame.image is None or frame.camera is None:
            continue
        into.frames += 1
        ignored = parts.get(index, ())
        vehicles = tuple(box for box in _vehicles(frame, detectors) if not _is_left_out(box.bbox, ignored))
        confirmed = _vehicles(frame, second) if second is not None else ()
        _compare(recording, index, frame.t_ns / 1e9, truth, vehicles, confirmed, frame.camera, into)


def _opened(spec: str | None, source: Source, looks_far: bool) -> Detectors:
    network = detector_for(source, spec)
    return Detectors(network, far=far_view_for(source, network) if looks_far else None)


def _vehicles(frame: Frame, detectors: Detectors) -> tuple[Detection, ...]:
    """The vehicles that are found in an image."""
    found = detect(frame, detectors).raw_boxes
    assert found is not None
    return tuple(box for box in select(found, DetectionParams()) if box.label in VEHICLES)


def _compare(
    recording: int,
    index: int,
    t_s: float,
    truth: tuple[TruthObject, ...],
    boxes: tuple[Detection, ...],
    confirmed: tuple[Detection, ...],
    camera: CameraCalibration,
    into: Counted,
) -> None:
    """confirmed: what the second network finds."""
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
        others = [k for k in range(len(boxes)) if k != best and overlap[n, k] > DOUBLE]
        doubled = any(int(overlap[:, k].argmax()) == n and overlap[:, k].max() < _SAME for k in others)
        offs = (np.array(box.bbox) - place) / height if box is not None else None
        away_m = hypot(*item.cuboid.center[:2]) - item.cuboid.size[0] / 2
        shown, share = visible_part(place, [other for _, other in known[:n]])
        hidden = (np.array(shown) - place) / height
        into.seen.append(
            JudgedVehicle(
                recording,
                index,
                t_s,
                item.id,
                item.label,
                away_m,
                share,
                hidden,
                box,
                offs,
                height,
                is_found and doubled,
            )
        )
    scale = _FOCAL_PX / float(camera.K[0, 0])
    agreed = iou_matrix(detected, np.array([box.bbox for box in confirmed]).reshape(-1, 4))
    for k, box in enumerate(boxes):
        is_confirmed = len(confirmed) > 0 and agreed[k].max() > _CONFIRMED
        if not is_confirmed and (not len(known) or overlap[:, k].max() < _FALSE):
            x1, y1, x2, y2 = (float(edge) * scale for edge in box.bbox)
            bearing = degrees(atan2((x1 + x2) / 2 / scale - camera.K[0, 2], camera.K[0, 0]))
            into.false.append((recording, t_s, (x1, y1, x2, y2), abs(bearing), box.score))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", metavar="URI[=LABELS]")
    parser.add_argument("--detector", help="name or file; the default network without")
    parser.add_argument("--whole", action="store_true", help="without the far view")
    parser.add_argument("--second", help="another network; boxes that it confirms are not counted as false")
    parser.add_argument("--out", type=Path, default=FILE)
    asked: Any = parser.parse_args(arguments)
    networks = MeasuredNetworks(asked.detector, not asked.whole, asked.second)
    counted, names = Counted(), []
    for n, each in enumerate(asked.recordings):
        uri, _, labels = each.partition("=")
        before = counted.frames
        count(n, open_source(uri), labels, networks, counted)
        names.append(f"{Path(uri).name}: {counted.frames - before} labelled frames")
    detector = Path(asked.detector).stem if asked.detector else "default network"
    view = "whole images only" if asked.whole else "whole images and far view"
    names.append(f"detector: {detector}, {view}")
    if asked.second:
        names.append(f"false boxes: without those confirmed by {Path(asked.second).stem}")
    noise = summed_up(counted, names)
    asked.out.write_text(json.dumps(noise.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
