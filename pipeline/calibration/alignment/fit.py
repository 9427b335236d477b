"""Fits the alignment of LiDAR and camera to an ordinary drive, without a target, picked points or an initial guess.

1. **Coarse.** For every mount (and lens, for the angular model) of a grid, count how many of the detector's boxes have
   a cluster where that mount predicts one. The correct one stands out over many frames. A pinhole model is searched
   twice, with the calibration's focal length and with any; the second counts only where the first is clearly wrong
   (``solve``).
2. **Fine.** From the best few mounts: pair each box with its cluster, move the projected edges onto the box's edges
   with a robust loss, and pair again more strictly, until both converge.
3. **Roll.** Boxes ahead hardly determine it; edges of the images do (``edges``).
4. **Edges.** Near that mount, the same edges determine all of it, without the errors that a detector's boxes share in
   all frames (``edge_fit``). An angular model has no mount; its four numbers are those with the
   largest overlap (``overlaps``).
5. **Uncertainty.** Where boxes alone determine the mount, the fit is repeated on frames resampled from blocks of the
   drive (bootstrap); where edges do, their blocks are compared. Held-out frames show how good the result is, and the
   drive itself whether it could determine it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.alignment.projection import corrected
from pipeline.calibration.alignment.doubts import looks_like_radians, warnings_of
from pipeline.calibration.alignment.edges import EdgeView, RollScores
from pipeline.calibration.alignment.models import PLACE, FitModel, ModelName, rounded
from pipeline.calibration.alignment.overlaps import Overlaps, overlaps_of
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.calibration.alignment.search import GATES, explained, refine
from pipeline.calibration.alignment.solve import SHARED_DEG, SHARED_WITH_PLACE, SHARED_ZOOM, SOLVE_STEPS, solve
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.params import AlignmentParams
from pipeline.types import F64, I64

BOOTSTRAPS = 24
STEPS = SOLVE_STEPS + BOOTSTRAPS
"""Number of progress steps of a fit."""
CLEAR_SIGMAS = 3.0
"""Random differences between blocks of the drive stay below this many standard deviations in sum."""
BLOCK_NS = 1_000_000_000
"""Frames within a second show the same cars and are resampled together."""
HELD_OUT = 5
"""Every fifth block is held out for the score."""
WORSE_IOU = 0.02
"""Loss of overlap from which a fit is doubted; right ones are within 0.01 of the calibration's."""
FEWEST_PAIRS = 12
"""Minimum number of pairs for a fit."""


class NothingToFit(BadInput):
    """A drive with too little information for a fit; the text says what is missing."""


@dataclass(frozen=True)
class AlignmentFit:
    """A fitted alignment and its reliability."""

    model: ModelName
    """Which of the two projections was fitted."""
    values: Mapping[str, float]
    """Of ``AlignmentParams``, by name."""
    sigmas: Mapping[str, float]
    """Standard deviation of each value."""
    frames: int
    """Number of frames with boxes and clusters used for the fit."""
    pairs: int
    """Boxes paired with a cluster."""
    before: Overlaps | None
    """With the current alignment; None without one."""
    after: Overlaps
    """With the fit."""
    held_out: bool
    """Whether the overlaps are from held-out frames; a very short drive has too few."""
    warnings: tuple[str, ...] = field(default=())
    """What the drive does not determine, as sentences."""
    place_m: Mapping[str, float] = field(default_factory=dict)
    """The camera's shift as it was, as far as it was not fitted and is not zero."""

    @property
    def section(self) -> dict[str, float | str]:
        """The alignment parameters to use with the fit."""
        lens = {"zoom": 1.0} if self.model == "pinhole" else {}  # a fit starts from the calibration's own
        return {"model": self.model, **lens, **self.place_m, **self.values}

    @property
    def changes(self) -> dict[str, float | str]:
        """``section`` by dotted name, as a change of parameters."""
        return {f"alignment.{name}": value for name, value in self.section.items()}


def overlap_sentence(fit: AlignmentFit) -> str:
    """The improvement by the fit, as a sentence."""
    before = f"{100 * fit.before.mean_iou:.0f} % → " if fit.before is not None else ""
    where = "of held-out frames" if fit.held_out else "of the fitted frames; the drive is too short to hold any out"
    return f"Projected clusters cover {before}{100 * fit.after.mean_iou:.0f} % of {fit.after.boxes} boxes {where}"


def fit_alignment(
    scenes: Sequence[FitScene],
    name: ModelName,
    present: AlignmentParams,
    offset: bool = False,
    progress: Progress = silent,
    edges: Sequence[EdgeView] = (),
) -> AlignmentFit:
    """The model's parameters from frames of one camera.

    edges: of frames of the same camera; they determine the roll of a pinhole model. present: scored for comparison, not
    a start; a pinhole model keeps its position. offset: of a pinhole model, also fit the position, laterally and in
    height. NothingToFit if too little is visible.
    """
    scenes = _of_one_camera(scenes)
    if name == "pinhole" and scenes[0].camera is None:
        raise NothingToFit("the pinhole model needs the camera's calibration; fit the angular model instead")
    place_m = {each: value for each in PLACE if name == "pinhole" and (value := getattr(present, each))}
    model = FitModel(name, scenes[0].camera, scenes[0].size, offset, place_m=place_m)
    train, held = _split(scenes)
    table = PairTable.of([scenes[k] for k in train])
    numbers = {scenes[k].t_ns // BLOCK_NS for k in train}
    views = [each for each in edges if each.t_ns // BLOCK_NS in numbers]
    model, found, by_edges, rolls = solve(table, views, model, progress, STEPS)
    if len(found[0].rows) < FEWEST_PAIRS:
        raise NothingToFit(_too_few(len(found[0].rows), len(table.boxes)))
    vector, rows = found[0].vector, found[0].rows
    blocks = _blocks([scenes[k] for k in train])
    if by_edges is None:
        by_edges = model.spread(_bootstrap(table, model, vector, blocks, rolls, progress))
    sigmas = _with_shared(model, vector, by_edges)
    warnings = warnings_of(table, model, found, sigmas)
    if looks_undistorted(table, model, vector, blocks):
        warnings += ("the boxes fit better without lens distortion: are the images already undistorted?",)
    if model.camera is not None and model.name == "pinhole":
        fitted = corrected(model.params(vector), model.camera)
        if looks_like_radians(model.camera, fitted):
            warnings += ("the angles of the calibration's mount look like radians where degrees are expected",)
    judged = PairTable.of([scenes[k] for k in held]) if held else table
    start = model.vector(present)
    after, *before = overlaps_of(judged, model, [vector, *([start] if start is not None else [])])
    if before and held and after.mean_iou < before[0].mean_iou - WORSE_IOU:
        warnings += ("clusters and boxes of held-out frames cover each other less than with the current alignment",)
    return AlignmentFit(
        model=name,
        values=rounded(model.values(vector)),
        sigmas={key: round(value, 5) for key, value in sigmas.items()},
        frames=len(train),
        pairs=len(rows),
        before=before[0] if before else None,
        after=after,
        held_out=bool(held),
        warnings=warnings,
        place_m={each: value for each, value in place_m.items() if each not in model.unknowns},
    )


def looks_undistorted(table: PairTable, model: FitModel, vector: F64, blocks: list[I64]) -> bool:
    """Whether the boxes fit clearly better without the calibration's distortion, as with images that are already
    undistorted: by the sum over the blocks of the drive, relative to their scatter."""
    if model.name != "pinhole" or model.camera is None or not np.any(model.camera.distortion):
        return False
    flat = replace(model, camera=replace(model.camera, distortion=np.zeros(0)))
    without = refine(table, flat, vector, GATES[-3:]).vector
    parts = [table.taken(block) for block in blocks]
    gained = np.array([explained(part, flat, without) - explained(part, model, vector) for part in parts])
    return bool(gained.sum() > CLEAR_SIGMAS * np.sqrt(np.sum(gained**2)))


def _with_shared(model: FitModel, vector: F64, sigmas: Mapping[str, float]) -> dict[str, float]:
    """The standard deviations with the errors that all frames share; an angular model's origin stands for yaw and
    pitch."""
    shared = (SHARED_WITH_PLACE if model.offset else SHARED_DEG) | {"zoom": SHARED_ZOOM}
    if model.name == "angular":
        px_per_deg = 1.0 / model.values(vector)["h_res_deg"]
        shared = {"cx_px": SHARED_DEG["yaw_deg"] * px_per_deg, "cy_px": SHARED_DEG["pitch_deg"] * px_per_deg}
    return {name: float(np.hypot(sigma, shared.get(name, 0.0))) for name, sigma in sigmas.items()}


def _bootstrap(
    table: PairTable, model: FitModel, vector: F64, blocks: list[I64], rolls: RollScores | None, progress: Progress
) -> F64:
    """(K, P) vectors fitted to resampled blocks of frames, with the roll of resampled edges."""
    rng, found = np.random.default_rng(0), []
    for number in range(BOOTSTRAPS):
        progress(SOLVE_STEPS + number, STEPS)
        drawn = np.concatenate([blocks[k] for k in rng.integers(0, len(blocks), len(blocks))])
        if rolls is not None:
            roll_deg = rolls.best_deg(rng.integers(0, len(rolls.blocks), len(rolls.blocks)))
            model = replace(model, roll_deg=(roll_deg, model.roll_deg[1]))
        found.append(refine(table.taken(drawn), model, vector, GATES[-2:]).vector)
    return np.array(found)


def _blocks(scenes: Sequence[FitScene]) -> list[I64]:
    """Frame numbers grouped into blocks that show the same scene."""
    number = np.array([each.t_ns // BLOCK_NS for each in scenes])
    return [np.flatnonzero(number == block) for block in np.unique(number)]


def _split(scenes: Sequence[FitScene]) -> tuple[list[int], list[int]]:
    """Frames used for the fit, and held-out frames, in whole blocks; with few blocks none is held out."""
    blocks = _blocks(scenes)
    if len(blocks) < HELD_OUT:
        return list(range(len(scenes))), []
    held = {int(k) for number, block in enumerate(blocks) if number % HELD_OUT == HELD_OUT // 2 for k in block}
    return [k for k in range(len(scenes)) if k not in held], sorted(held)


def _of_one_camera(scenes: Sequence[FitScene]) -> list[FitScene]:
    """Frames with the most frequent image size. NothingToFit without any."""
    if not scenes:
        raise NothingToFit("no frame has a LiDAR sweep with clusters and an image with vehicles in it")
    sizes = [each.size for each in scenes]
    usual = max(set(sizes), key=sizes.count)
    return [each for each in scenes if each.size == usual]


def _too_few(pairs: int, boxes: int) -> str:
    return (
        f"only {pairs} of {boxes} detected vehicles can be paired with LiDAR clusters at once; "
        "choose a drive with more traffic within 40 m"
    )
