"""The distance law fitted to real recordings, and the camera judged with a law that never saw the judged drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.calibration.distance import Pair, TooFewPairs, as_overrides, collect_pairs, fit_laws
from pipeline.common.geometry import iou_matrix
from pipeline.evaluation.lead_verdict import LeadRule, nearest_face_m, true_lead
from pipeline.params import Params, with_changes
from pipeline.sources import open_source
from pipeline.types import REAL_VEHICLES, RawBoxes
from pipeline.types.source import InParts, Source
from pipeline.vision import distance, nms, tracking
from tests.looking import LooksOnce, yolox_nano

DRIVES = {"047": (47, 51), "057": (57, 68), "183": (183, 192), "414": (414, 425)}
JUDGED = {"057": (60, 68), "183": (183, 192), "414": (414, 425)}


@dataclass(frozen=True)
class Recording:
    source: Source
    detector: LooksOnce[RawBoxes]
    pairs: tuple[Pair, ...]
    names: tuple[str, ...]


@pytest.fixture(scope="module")
def astyx(data_dir: Path) -> Recording:
    return _recording(f"astyx:{data_dir / 'astyx'}", data_dir, (2048, 618))


@pytest.fixture(scope="module")
def kitti(data_dir: Path) -> Recording:
    return _recording(f"kitti:{data_dir / 'kitti_0052'}", data_dir, (1242, 375))


def _recording(uri: str, data_dir: Path, size: tuple[int, int]) -> Recording:
    source, detector = open_source(uri), yolox_nano(data_dir, *size)
    assert isinstance(source, InParts)
    names = tuple(frame.name for frame in source.outlines())
    return Recording(source, detector, collect_pairs(source, detector), names)


def _within(name: str, frames: tuple[int, int]) -> bool:
    return frames[0] <= int(name) <= frames[1]


def test_real_cars_obey_a_pinhole_law(astyx: Recording, kitti: Recording) -> None:
    fit = fit_laws(astyx.pairs + kitti.pairs, exponent=-1.0)["car"]
    assert fit.pairs > 100
    car_m = fit.law.coefficient / Params().distance.reference_focal_px
    assert 1.45 < car_m < 1.7
    assert fit.log_sigma < 0.2


def test_the_default_law_is_the_one_fitted_to_drives_that_are_not_judged(astyx: Recording, kitti: Recording) -> None:
    unseen = [pair for pair in astyx.pairs if not any(_within(pair.frame, frames) for frames in JUDGED.values())]
    fit = fit_laws([*unseen, *kitti.pairs], exponent=-1.0)["car"]
    assert REAL_VEHICLES.coefficient == pytest.approx(fit.law.coefficient, rel=0.02)


def test_the_camera_alone_with_a_law_that_never_saw_the_drive(astyx: Recording, kitti: Recording) -> None:
    """Leave one drive out: the lead's distance is within 12 % on average, and within 8 % in half of the frames."""
    errors = []
    for drive, judged in JUDGED.items():
        others = [pair for pair in astyx.pairs if not _within(pair.frame, DRIVES[drive])]
        overrides = as_overrides(fit_laws([*others, *kitti.pairs], exponent=-1.0))["distance"]
        params = with_changes(Params(), {f"distance.{key}": value for key, value in overrides.items()})
        errors += _lead_errors(astyx, judged, params)
    assert len(errors) >= 28
    assert np.mean(np.abs(errors)) <= 0.12
    assert np.median(np.abs(errors)) <= 0.08


def _lead_errors(recording: Recording, frames: tuple[int, int], params: Params) -> list[float]:
    """Relative error of the track whose box fits the labelled lead best, with the camera alone, by frame."""
    state, before_ns, errors = tracking.VisionTrackerState(), None, []
    for index in (k for k, name in enumerate(recording.names) if _within(name, frames)):
        frame = recording.source.frame(index)
        alignment = resolve(params.alignment, frame.camera)
        assert frame.image is not None
        assert frame.camera is not None
        assert alignment is not None
        detections = nms.select(recording.detector.detect(frame.image.bgr), params.detection)
        measured = distance.measure(detections, alignment, frame.camera, params.distance)
        dt_s = (frame.t_ns - before_ns) / 1e9 if before_ns is not None else None
        state, tracks = tracking.track(state, measured, dt_s, params.vision_tracking)
        before_ns = frame.t_ns
        lead = true_lead(recording.source.truth(index) or (), LeadRule())
        placed = [item for item in tracks if item.distance_m is not None]
        if lead is None or not placed:
            continue
        box = project_cuboid(alignment, lead.cuboid.corners(), frame.camera.width, frame.camera.height)
        iou = iou_matrix(np.array([item.bbox for item in placed]), np.array([box]))[:, 0]
        if iou.max() >= 0.4:
            errors.append(float(placed[int(iou.argmax())].distance_m or 0.0) / nearest_face_m(lead) - 1.0)
    return errors


def test_the_lidar_can_stand_in_for_labels(kitti: Recording) -> None:
    """Laws fitted to the LiDAR's boxes agree with those fitted to labels within 20 %, on unlabelled frames."""
    by_lidar = collect_pairs(kitti.source, kitti.detector, "lidar")
    assert len({pair.frame for pair in by_lidar}) > 10
    lidar, labels = (fit_laws(pairs, exponent=-1.0)["car"].law for pairs in (by_lidar, kitti.pairs))
    assert lidar.coefficient == pytest.approx(labels.coefficient, rel=0.2)


def _pairs(label: str, height_m: float, focal: float = 1000.0) -> list[Pair]:
    return [Pair("0", label, focal * height_m / depth, depth, depth) for depth in (10.0, 20.0, 30.0, 50.0)]


def test_laws_by_class_become_parameters() -> None:
    overrides = as_overrides(fit_laws(_pairs("car", 1.5) + _pairs("truck", 3.0) + _pairs("bicycle", 1.8)))
    assert overrides == {"distance": {"coefficient": 1500.0, "exponent": -1.0, "truck_ratio": 2.0}}
    with_changes(Params(), {f"distance.{key}": value for key, value in overrides["distance"].items()})


def test_figures_say_how_well_a_law_fits() -> None:
    pairs = _pairs("car", 1.5)
    pairs[0] = replace(pairs[0], depth_m=pairs[0].depth_m / 1.2)
    fit = fit_laws(pairs, exponent=-1.0)["car"]
    assert (fit.pairs, fit.log_sigma) == (4, pytest.approx(0.0, abs=1e-6))
    assert fit.mean_relative_error == pytest.approx(0.2 / 4, rel=1e-4)


@pytest.mark.parametrize("pairs", [[], _pairs("car", 1.5)[:1]], ids=["none", "one"])
def test_too_few_pairs_is_a_sentence(pairs: list[Pair]) -> None:
    with pytest.raises(TooFewPairs, match="too few detected vehicles"):
        fit_laws(pairs)


def test_other_classes_alone_make_no_parameters() -> None:
    with pytest.raises(TooFewPairs, match="no car"):
        as_overrides(fit_laws(_pairs("truck", 3.0)))
