"""Fits the alignment of LiDAR and camera to an ordinary drive, without a target, picked points or an initial guess.

1. **Coarse.** For every mount (and lens, for the angular model) of a grid, count how many of the detector's boxes have
   a cluster where that mount predicts one. The correct one stands out over many frames.
2. **Fine.** From the best few mounts: pair each box with its cluster, move the projected edges onto the box's edges
   with a robust loss, and pair again more strictly, until both converge.
3. **Uncertainty.** The fit is repeated on frames resampled from blocks of the drive (bootstrap); the spread is the
   uncertainty. Held-out frames show how good the result is, and the drive itself whether it could determine it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from pipeline.calibration.alignment.doubts import Found, warnings_of
from pipeline.calibration.alignment.models import STEP_DEG, FitModel, ModelName
from pipeline.calibration.alignment.pairs import PairTable, coarse_scores
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.params import AlignmentParams
from pipeline.types import F64, I64

COARSE_FRAMES, FIRST_FRAMES, FIRST_SHARE = 30, 8, 0.1
"""The coarse search uses the frames with the most boxes: a few for the whole grid, then more for its best tenth."""
_COARSE_STEPS = 8
STARTS = 6
"""Number of best grid points that are refined."""
GATES = ((4.0, 3.0), (2.5, 2.5), (1.5, 2.5), (1.0, 2.5), (1.0, 2.5), (1.0, 2.5))
"""Rounds of the refinement: factor on the edge uncertainty, and the pairs' gate in standard deviations."""
LOSS_SCALE = 1.0
"""Standard deviations from which the loss grows only linearly (soft L1)."""
ROLL_SIGMA_DEG, OFFSET_SIGMA_M = 5.0, 0.3
"""Prior for roll and the camera's position, if the pairs do not determine them."""
SQUARE_SIGMA = 0.02
"""Permitted relative difference of the two resolutions of a camera with square pixels."""
BOOTSTRAPS = 24
STEPS = _COARSE_STEPS + STARTS + BOOTSTRAPS
"""Number of progress steps of a fit."""
CLEAR_SIGMAS = 3.0
"""Random differences between blocks of the drive stay below this many standard deviations in sum."""
BLOCK_NS = 1_000_000_000
"""Frames within a second show the same cars and are resampled together."""
HELD_OUT = 5
"""Every fifth block is held out for the score."""
COVERED_IOU = 0.3
"""A box with a smaller overlap may belong to an object that only the camera sees."""
FEWEST_PAIRS = 12
"""Minimum number of pairs for a fit."""


class NothingToFit(BadInput):
    """A drive with too little information for a fit; the text says what is missing."""


@dataclass(frozen=True)
class Overlaps:
    """Overlap of projected clusters and boxes, over the held-out frames."""

    mean_iou: float
    """Over the boxes that are covered by a cluster, before or after the fit."""
    paired: int
    """Number of these boxes with an IoU of at least one half."""
    boxes: int
    """Number of these boxes."""


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

    @property
    def changes(self) -> dict[str, float | str]:
        """By dotted name, as a change of parameters."""
        return {"alignment.model": self.model, **{f"alignment.{name}": value for name, value in self.values.items()}}


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
) -> AlignmentFit:
    """The model's parameters from frames of one camera.

    present: scored for comparison; the fit does not start from it. offset: of a pinhole model, also fit the camera's
    position. NothingToFit if too little is visible.
    """
    scenes = _of_one_camera(scenes)
    if name == "pinhole" and scenes[0].camera is None:
        raise NothingToFit("the pinhole model needs the camera's calibration; fit the angular model instead")
    model = FitModel(name, scenes[0].camera, scenes[0].size, offset)
    train, held = _split(scenes)
    table = PairTable.of([scenes[k] for k in train])
    found = _search(table, model, progress)
    vector, rows = found[0].vector, found[0].rows
    if len(rows) < FEWEST_PAIRS:
        raise NothingToFit(_too_few(len(rows), len(table.boxes)))
    blocks = _blocks([scenes[k] for k in train])
    spread = _bootstrap(table, model, vector, blocks, progress)
    warnings = warnings_of(table, model, found, model.spread(spread))
    if looks_undistorted(table, model, vector, blocks):
        warnings += ("the boxes fit better without the lens distortion: are the images undistorted already?",)
    judged = PairTable.of([scenes[k] for k in held]) if held else table
    start = model.vector(present)
    after, *before = _overlaps(judged, model, [vector, *([start] if start is not None else [])])
    return AlignmentFit(
        model=name,
        values=_rounded(model.values(vector)),
        sigmas={key: round(value, 5) for key, value in model.spread(spread).items()},
        frames=len(train),
        pairs=len(rows),
        before=before[0] if before else None,
        after=after,
        held_out=bool(held),
        warnings=warnings,
    )


# ---------------------------------------------------------------- coarse and fine search


def _search(table: PairTable, model: FitModel, progress: Progress) -> list[Found]:
    """Refined optima, best first."""
    grid = model.grid()
    slack_px = 0.6 * STEP_DEG * _pixels_per_degree(model)
    scores = np.zeros(len(grid))
    few = _richest(table, FIRST_FRAMES)
    for part, at in enumerate(np.array_split(np.arange(len(grid)), _COARSE_STEPS)):
        progress(part, STEPS)
        scores[at] = coarse_scores(few, model, grid[at], 2.0, slack_px)
    best = np.argsort(-scores, kind="stable")[: max(STARTS, round(FIRST_SHARE * len(grid)))]
    grid, scores = grid[best], coarse_scores(_richest(table, COARSE_FRAMES), model, grid[best], 2.0, slack_px)
    found = []
    for number, start in enumerate(_peaks(model, grid, scores)):
        progress(_COARSE_STEPS + number, STEPS)
        found.append(refine(table, model, start))
    return sorted(found, key=lambda each: -each.explained)


def _pixels_per_degree(model: FitModel) -> float:
    if model.camera is not None:
        return float(model.camera.K[0, 0] * np.radians(1.0))
    return model.size[0] / 60.0


def _richest(table: PairTable, frames: int) -> PairTable:
    """Only the frames with the most boxes."""
    count = np.bincount(table.frame)
    return table.taken(np.sort(np.argsort(-count, kind="stable")[:frames]))


def _peaks(model: FitModel, grid: F64, scores: F64) -> list[F64]:
    """The best grid points that are not neighbours of each other."""
    scale = np.array([0.2, 0.2, 4.0, 4.0]) if model.name == "angular" else np.full(grid.shape[1], 2.5)
    chosen: list[F64] = []
    for vector in grid[np.argsort(-scores, kind="stable")]:
        if all(np.abs((vector - other) / scale).max() > 1.0 for other in chosen):
            chosen.append(vector)
            if len(chosen) == STARTS:
                break
    return chosen


def refine(table: PairTable, model: FitModel, start: F64, gates: Sequence[tuple[float, float]] = GATES) -> Found:
    """Repeatedly match pairs and optimise, from a start within some degrees."""
    vector, rows = start, np.zeros(0, np.int64)
    low, high = model.bounds()
    for widen, gate in gates:
        rows = table.matched(table.residuals(model.aligned(vector), widen), gate)
        if len(rows) < 3:
            break
        some = table.only(rows)

        def off(at: F64, some: PairTable = some, widen: float = widen) -> F64:
            return np.concatenate([some.residuals(model.aligned(at), widen).ravel(), _prior(model, at)])

        solved = least_squares(
            off, np.clip(vector, low + 1e-9, high - 1e-9), bounds=(low, high), loss="soft_l1", f_scale=LOSS_SCALE
        )
        vector = solved.x
    return Found(vector, rows, _explained(table, model, vector))


def _explained(table: PairTable, model: FitModel, vector: F64) -> float:
    """Number of boxes with a cluster of their own, weighted by the quality of the match."""
    off = table.residuals(model.aligned(vector), 1.5)
    return float(np.exp(-0.5 * np.mean(off[table.matched(off, np.inf)] ** 2, axis=1)).sum())


def _prior(model: FitModel, vector: F64) -> F64:
    """Residuals of the prior, in standard deviations."""
    if model.name == "pinhole":
        return vector[2:] / [ROLL_SIGMA_DEG, OFFSET_SIGMA_M, OFFSET_SIGMA_M][: len(vector) - 2]
    return np.array([(vector[1] - vector[0]) / SQUARE_SIGMA])


# ---------------------------------------------------------------- uncertainty


def looks_undistorted(table: PairTable, model: FitModel, vector: F64, blocks: list[I64]) -> bool:
    """Whether the boxes fit clearly better without the calibration's distortion, as with images that are already
    undistorted: by the sum over the blocks of the drive, relative to their scatter."""
    if model.name != "pinhole" or model.camera is None or not np.any(model.camera.distortion):
        return False
    flat = replace(model, camera=replace(model.camera, distortion=np.zeros(0)))
    without = refine(table, flat, vector, GATES[-3:]).vector
    parts = [table.taken(block) for block in blocks]
    gained = np.array([_explained(part, flat, without) - _explained(part, model, vector) for part in parts])
    return bool(gained.sum() > CLEAR_SIGMAS * np.sqrt(np.sum(gained**2)))


def _bootstrap(table: PairTable, model: FitModel, vector: F64, blocks: list[I64], progress: Progress) -> F64:
    """(K, P) vectors fitted to resampled blocks of frames."""
    rng, found = np.random.default_rng(0), []
    for number in range(BOOTSTRAPS):
        progress(_COARSE_STEPS + STARTS + number, STEPS)
        drawn = np.concatenate([blocks[k] for k in rng.integers(0, len(blocks), len(blocks))])
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


def _overlaps(table: PairTable, model: FitModel, vectors: Sequence[F64]) -> list[Overlaps]:
    """The overlaps for each vector, over the same boxes: those seen by both sensors. Distant ones have no cluster in
    any case."""
    best = np.zeros((len(vectors), len(table.boxes)))
    for row, vector in zip(best, vectors, strict=True):
        np.maximum.at(row, table.box, table.overlap(model.aligned(vector)))
    shared = best[:, best.max(axis=0) >= COVERED_IOU]
    return [
        Overlaps(round(float(row.mean()), 4) if len(row) else 0.0, int(np.count_nonzero(row >= 0.5)), len(row))
        for row in shared
    ]


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


def _rounded(values: Mapping[str, float]) -> dict[str, float]:
    digits = {"h_res_deg": 5, "v_res_deg": 5, "cx_px": 1, "cy_px": 1}
    return {name: round(value, digits.get(name, 3)) for name, value in values.items()}
