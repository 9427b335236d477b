"""Fits the distance law to another camera: the paper's regression, on any labelled recording.

A pair is one detected box and the true depth of its object. Ground truth comes from labelled cuboids, or from LiDAR
boxes wherever they overlap a detection in the image.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.alignment.projection import Alignment, project_cuboid, resolve
from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid, closest_on_polygon, iou_matrix, transform
from pipeline.common.robust import mad_sigma
from pipeline.lidar import boxes, cluster, downsample, ground
from pipeline.params import Params
from pipeline.types import REAL_VEHICLES, VEHICLES, CameraCalibration, DistanceLaw, Frame
from pipeline.types.source import Source
from pipeline.vision.detector import Detector
from pipeline.vision.distance import PowerLaw, fit_power_law, height_at_reference, is_cut
from pipeline.vision.nms import select

MIN_IOU = 0.4
MIN_DEPTH_M = 3.0
"""Closer, a face of the object no longer fills the box, so the box height is not usable."""


class TooFewPairs(BadInput):
    """A recording without enough labelled boxes to fit anything; one sentence."""


@dataclass(frozen=True)
class Pair:
    """One box with its truth."""

    frame: str
    """The recording's own name of it."""
    label: str
    """Class of the labelled object; each class has its own law."""
    height_px: float
    """Of the box, converted to the reference camera."""
    depth_m: float
    """Of the object's nearest point, along the optical axis."""
    range_m: float
    """Horizontal range of the same point from the ego origin."""


@dataclass(frozen=True)
class LawFit:
    """A class's law and its fit to its own pairs."""

    law: PowerLaw
    """Distance as a function of box height."""
    pairs: int
    """Number of pairs used for the fit."""
    mean_relative_error: float
    """Mean error as a share of the true depth."""
    p90_relative_error: float
    """90th percentile of the same."""
    log_sigma: float
    """Robust standard deviation of the logarithm of estimate over truth."""


def collect_pairs(
    source: Source, detector: Detector, truth: Literal["labels", "lidar"] = "labels", params: Params | None = None
) -> tuple[Pair, ...]:
    """Every detected vehicle of a recording that overlaps a true object's projection, one-to-one."""
    params = params or Params()
    pairs: list[Pair] = []
    for index in range(len(source)):
        if truth == "labels" and source.truth(index) is None:
            continue
        frame = source.frame(index)
        alignment = resolve(params.alignment, frame.camera)
        if frame.image is None or frame.camera is None or alignment is None:
            continue
        cuboids = _labelled(source, index) if truth == "labels" else _clusters(frame, params)
        pairs += _frame_pairs(frame, frame.camera, cuboids, alignment, detector, params)
    return tuple(pairs)


def fit_laws(pairs: Iterable[Pair], exponent: float | None = None) -> Mapping[str, LawFit]:
    """A law for each class with pairs at two or more heights (one, with the exponent given), by class name.

    TooFewPairs if there is no such class.
    """
    by_class: dict[str, list[Pair]] = {}
    for pair in pairs:
        by_class.setdefault(pair.label, []).append(pair)
    needed = 2 if exponent is None else 1
    fits = {
        label: _fit(members, exponent)
        for label, members in sorted(by_class.items())
        if len({pair.height_px for pair in members}) >= needed
    }
    if not fits:
        raise TooFewPairs("too few detected vehicles with a known distance to fit a law")
    return fits


def as_overrides(fits: Mapping[str, LawFit]) -> dict[str, dict[str, float]]:
    """The fitted laws as a section of a parameter file: the car's law, and the height ratios of the other classes.
    TooFewPairs without cars, because the other laws are relative to the car's."""
    if "car" not in fits:
        raise TooFewPairs(
            "no car with a known distance was detected; the laws of other classes are relative to a car's"
        )
    car = fits["car"].law
    section = {"coefficient": round(car.coefficient, 1), "exponent": round(car.exponent, 4)}
    for label in ("truck", "bus", "motorcycle"):
        if label in fits:
            section[f"{label}_ratio"] = round(_height_ratio(car, fits[label]), 2)
    return {"distance": section}


def as_law(fits: Mapping[str, LawFit], focal_px: float) -> DistanceLaw:
    """The fitted laws as a detector's own, for heights at ``focal_px``. A class that was not seen keeps the height
    ratio of real vehicles. TooFewPairs without cars."""
    return replace(REAL_VEHICLES, focal_px=focal_px, **as_overrides(fits)["distance"])


def _height_ratio(car: PowerLaw, other: LawFit) -> float:
    """Height of the class relative to a car, from both boxes at 30 m."""

    def height_px(law: PowerLaw) -> float:
        return float((30.0 / law.coefficient) ** (1.0 / law.exponent))

    return height_px(other.law) / height_px(car)


def _fit(pairs: list[Pair], exponent: float | None) -> LawFit:
    height = np.array([pair.height_px for pair in pairs])
    depth = np.array([pair.depth_m for pair in pairs])
    law = fit_power_law(height, depth, exponent)
    ratio = law.coefficient * height**law.exponent / depth
    error = np.abs(ratio - 1.0)
    return LawFit(
        law,
        len(pairs),
        float(error.mean()),
        float(np.quantile(error, 0.9)),
        mad_sigma(np.log(ratio)),
    )


def _frame_pairs(
    frame: Frame,
    camera: CameraCalibration,
    cuboids: list[Cuboid],
    alignment: Alignment,
    detector: Detector,
    params: Params,
) -> list[Pair]:
    assert frame.image is not None
    detections = [d for d in select(detector.detect(frame.image.bgr), params.detection) if d.label in VEHICLES]
    projected = [project_cuboid(alignment, cuboid.corners(), camera.width, camera.height) for cuboid in cuboids]
    seen = [(cuboid, box) for cuboid, box in zip(cuboids, projected, strict=True) if box is not None]
    if not detections or not seen:
        return []
    iou = iou_matrix(np.array([d.bbox for d in detections]), np.array([box for _, box in seen]))
    pairs = []
    for row, detection in enumerate(detections):
        column = int(iou[row].argmax())
        mutual = int(iou[:, column].argmax()) == row
        if not mutual or iou[row, column] < MIN_IOU or is_cut(detection.bbox, camera):
            continue
        cuboid = seen[column][0]
        x, y = closest_on_polygon(cuboid.footprint())
        depth_m = float(transform(camera.T_camera_ego, np.array([[x, y, cuboid.center[2]]]))[0, 2])
        if depth_m >= MIN_DEPTH_M:
            height = height_at_reference(detection.bbox, float(camera.K[1, 1]), params.distance)
            pairs.append(Pair(frame.name, detection.label, height, depth_m, float(np.hypot(x, y))))
    return pairs


def _labelled(source: Source, index: int) -> list[Cuboid]:
    return [item.cuboid for item in source.truth(index) or ()]


def _clusters(frame: Frame, params: Params) -> list[Cuboid]:
    if frame.sweep is None:
        return []
    points = frame.sweep.points
    keep = downsample.keep_mask(frame.sweep, params.downsample)
    plane = ground.fit_ground(points, keep, params.ground)
    candidates = cluster.candidates(points, plane, keep, params.cluster)
    found = boxes.fit_obstacles(points, cluster.cluster(points, candidates, params.cluster), plane, params.box)
    return [obstacle.cuboid for obstacle in found]
