"""How close a fit of the alignment comes to the calibration of real recordings, from random starts.

    python -m tests.soak.alignment_starts kitti_0052 --frames 10 20 --starts 50

Each start turns the recording's calibration by up to ``OFF_DEG`` about each axis (with ``--offset``, it also shifts the
camera by up to ``OFF_M``) and takes its own random subset of the frames, with YOLOX-nano and 16 rings. The fit does not
know the calibration itself. ``--scale`` also makes the focal length wrong by up to ``OFF_SHARE``. ``--model angular``
draws both resolutions up to ``OFF_SHARE`` off, instead of the calibration's, and scores the IoU only: an angular model
has no mount. Prints one table row for each number of frames.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.alignment.projection import corrected
from pipeline.calibration.alignment.edges import EdgeView, frames_kept
from pipeline.calibration.alignment.fit import AlignmentFit, NothingToFit, fit_alignment
from pipeline.calibration.alignment.models import FitModel, ModelName
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.scenes import FitScene, fit_scene
from pipeline.calibration.depth_edges import edge_scene
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import inverse
from pipeline.detection import Detectors, detect
from pipeline.params import AlignmentParams, Params
from pipeline.sources import open_source
from pipeline.types import F64, CameraCalibration
from pipeline.vision.detector import open_detector

RECORDINGS = {
    "kitti_0052": ("kitti:kitti_0052",),
    "kitti_0009": ("kitti:kitti_0009/2011_09_26/2011_09_26_drive_0009_sync",),
    "astyx": ("astyx:astyx", "astyx:astyx_more"),
}
OFF_DEG, OFF_M, OFF_SHARE = 5.0, 0.2, 0.2
NEAR_DEG, NEAR_M = 0.3, 0.1
MOMENT_NS = 10_000_000_000
"""Frames of several files are separate moments: their times are this far apart."""


class View(NamedTuple):
    """A frame as the fit sees it."""

    scene: FitScene
    edges: EdgeView


class Start(NamedTuple):
    """What came of one start."""

    off: F64
    """(5,) errors in yaw, pitch, roll (degrees), left and up (metres); NaN without the camera's position."""
    sigmas: F64
    """(5,) standard deviations that the fit reports."""
    iou: float
    own_iou: float
    """With the fit, and with the recording's own calibration, in the frames that the fit did not see."""


def views_of(name: str) -> list[View]:
    """The frames of a recording with boxes and clusters."""
    found: list[View] = []
    for part, uri in enumerate(RECORDINGS[name]):
        kind, _, folder = uri.partition(":")
        source = open_source(f"{kind}:{data_dir() / folder}")
        detectors: Detectors | None = None
        for index in range(len(source)):
            frame = source.frame(index)
            if frame.image is None or frame.sweep is None:
                continue
            if detectors is None:
                height, width = frame.image.bgr.shape[:2]
                network = data_dir() / "models" / "yolox_nano.onnx"
                detectors = Detectors(open_detector(str(network), (width, height)))
            scene = fit_scene(detect(frame, detectors), Params())
            if scene is None:
                continue
            t_ns = scene.t_ns if len(RECORDINGS[name]) == 1 else (1000 * part + index) * MOMENT_NS
            edges = EdgeView(edge_scene(frame.sweep, frame.image.bgr), t_ns)
            found.append(View(replace(scene, t_ns=t_ns), edges))
    return found


def turned(camera: CameraCalibration, rng: np.random.Generator, with_place: bool) -> CameraCalibration:
    """The calibration as a careless person wrote it down."""
    yaw, pitch, roll = rng.uniform(-OFF_DEG, OFF_DEG, 3)
    left, up = rng.uniform(-OFF_M, OFF_M, 2) if with_place else (0.0, 0.0)
    values = {"yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll, "left_m": left, "up_m": up}
    return corrected(AlignmentParams.model_construct(**{**AlignmentParams().model_dump(), **values}), camera)


def errors(fit: AlignmentFit, given: CameraCalibration, true: CameraCalibration, with_place: bool) -> F64:
    """(5,) as in ``Start.off``: between the fitted camera and the true one, in ego axes."""
    values = {**AlignmentParams().model_dump(), **fit.values}
    T_ego_found = inverse(corrected(AlignmentParams.model_construct(**values), given).T_camera_ego)
    T_ego_true = inverse(true.T_camera_ego)
    turn = Rotation.from_matrix(T_ego_found[:3, :3] @ T_ego_true[:3, :3].T).as_euler("ZYX", degrees=True)
    place = T_ego_found[1:3, 3] - T_ego_true[1:3, 3] if with_place else np.full(2, np.nan)
    return np.concatenate([turn, place])


def iou_of(views: Sequence[View], values: Sequence[tuple[CameraCalibration | None, AlignmentParams]]) -> list[float]:
    """Mean IoU of boxes and clusters, over the boxes that any of the alignments covers by half; as the fit scores."""
    table = PairTable.of([each.scene for each in views])
    best = np.zeros((len(values), len(table.boxes)))
    for row, (camera, params) in zip(best, values, strict=True):
        model = FitModel(params.model, camera, views[0].scene.size, offset=True, zoom=params.zoom)
        vector = model.vector(params)
        assert vector is not None
        np.maximum.at(row, table.box, table.overlap(model.aligned(vector)))
    shared = best[:, best.max(axis=0) >= 0.3]
    return [float(row.mean()) if len(row) else np.nan for row in shared]


def start(
    views: Sequence[View], frames: int, number: int, model: ModelName, offset: bool, scale: bool = False
) -> Start | None:
    """One fit; None if it is refused. scale: the focal length is wrong, too."""
    rng = np.random.default_rng([frames, number])
    chosen = np.sort(rng.permutation(len(views))[:frames])
    others = [views[k] for k in range(len(views)) if k not in chosen] or list(views)
    true = views[0].scene.camera
    assert true is not None
    given = turned(true, rng, offset)
    if model == "angular":
        K = given.K.copy()
        K[0, 0] *= 1.0 + rng.uniform(-OFF_SHARE, OFF_SHARE)
        K[1, 1] *= 1.0 + rng.uniform(-OFF_SHARE, OFF_SHARE)
        given = replace(given, K=K)
    elif scale:
        K = given.K.copy()
        K[[0, 1], [0, 1]] *= 1.0 + rng.uniform(-OFF_SHARE, OFF_SHARE)
        given = replace(given, K=K)
    scenes = [replace(views[k].scene, camera=given) for k in chosen]
    edges = [views[chosen[k]].edges for k in frames_kept(len(chosen), scenes[0].size)]
    try:
        fit = fit_alignment(scenes, model, AlignmentParams(), offset, edges=edges)
    except NothingToFit:
        return None
    params = AlignmentParams.model_construct(**{**AlignmentParams().model_dump(), "model": model, **fit.values})
    own = AlignmentParams() if model == "pinhole" else AlignmentParams(model="angular")
    iou, own_iou = iou_of(others, [(given, params), (true, own)])
    names = ("yaw_deg", "pitch_deg", "roll_deg", "left_m", "up_m")
    off = errors(fit, given, true, offset) if model == "pinhole" else np.full(5, np.nan)
    return Start(off, np.array([fit.sigmas.get(name, np.nan) for name in names]), iou, own_iou)


def row(frames: int, found: Sequence[Start | None]) -> str:
    """Median and 90th percentile of each error, how many are near, and the IoU."""
    kept = [each for each in found if each is not None]
    if not kept:
        return f"| {frames} | all {len(found)} refused |"
    off = np.abs([each.off for each in kept])
    units = ("°", "°", "°", " m", " m")
    errors_of = [
        f"{np.median(off[:, k]):.2f}{unit}, {np.quantile(off[:, k], 0.9):.2f}{unit}" for k, unit in enumerate(units)
    ]
    near = [(off[:, :2] <= NEAR_DEG).all(axis=1), (off[:, :3] <= NEAR_DEG).all(axis=1)]
    near.append(near[1] & (off[:, 3:] <= NEAR_M).all(axis=1))
    counts = [f"{int(each.sum())}" for each in near]
    share = np.nanmean(off <= 2.0 * np.array([each.sigmas for each in kept]), axis=0)
    iou, own = (float(np.mean([getattr(each, name) for each in kept])) for name in ("iou", "own_iou"))
    refused = len(found) - len(kept)
    return (
        f"| {frames} | {' | '.join(errors_of)} | {' | '.join(counts)} of {len(found)}, {refused} refused "
        f"| {iou:.3f} | {own:.3f} | within 2σ: {np.round(share[:3], 2).tolist()}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", choices=RECORDINGS)
    parser.add_argument("--frames", type=int, nargs="+", default=[10, 20])
    parser.add_argument("--starts", type=int, default=50)
    parser.add_argument("--model", choices=("pinhole", "angular"), default="pinhole")
    parser.add_argument("--offset", action="store_true", help="also fit the camera's position")
    parser.add_argument("--scale", action="store_true", help="the focal length of the start is wrong, too")
    asked = parser.parse_args()
    views = views_of(asked.recording)
    print(
        f"{asked.recording}, {asked.model}{', with position' if asked.offset else ''}: {len(views)} frames", flush=True
    )
    print("| frames | yaw | pitch | roll | left | up | yaw, pitch near | roll too | place too | IoU | own | |")
    for frames in asked.frames:
        found = [start(views, frames, number, asked.model, asked.offset, asked.scale) for number in range(asked.starts)]
        print(row(frames, found), flush=True)


if __name__ == "__main__":
    main()
