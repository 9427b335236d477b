"""Fits the alignment of LiDAR and camera to an ordinary drive, without a target, picked points or an initial guess.

1. **Coarse.** For every mount (and lens, for the angular model) of a grid, count how many of the detector's boxes have
   a cluster where that mount predicts one. The correct one stands out over many frames.
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
from pipeline.calibration.alignment.doubts import Found, looks_like_radians, warnings_of
from pipeline.calibration.alignment.edge_fit import STEPS as EDGE_STEPS
from pipeline.calibration.alignment.edge_fit import fit_edges
from pipeline.calibration.alignment.edges import ROLL_STEPS, EdgeView, RollScores, roll_scores
from pipeline.calibration.alignment.models import PLACE, FitModel, ModelName, rounded
from pipeline.calibration.alignment.overlaps import Overlaps, most_overlap, overlaps_of
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.calibration.alignment.search import GATES, SEARCH_STEPS, explained, refine, search
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.params import AlignmentParams
from pipeline.types import F64, I64

_EXACT_DEG = 0.01
"""Standard deviation that holds a roll in place."""
BOOTSTRAPS = 24
_ROLLS_FROM = SEARCH_STEPS
_EDGES_FROM = _ROLLS_FROM + ROLL_STEPS
_BOOTSTRAPS_FROM = _EDGES_FROM + EDGE_STEPS
STEPS = _BOOTSTRAPS_FROM + BOOTSTRAPS
"""Number of progress steps of a fit."""
AGREED = 0.8
"""Share of what the boxes' mount explains that the edges' mount has to explain too. The boxes' shared error of some per
cent of their sides costs less than that; a mount that lies on other edges pairs fewer vehicles."""
AGREED_SIGMAS = 2.0
"""Largest turn in yaw and pitch that boxes ask for at the edges' mount, in standard deviations of both, with shared
errors. Where few edges end above or below, as in drawn images, edges put the pitch half a degree off."""
CLEAR_SIGMAS = 3.0
"""Random differences between blocks of the drive stay below this many standard deviations in sum."""
BLOCK_NS = 1_000_000_000
"""Frames within a second show the same cars and are resampled together."""
HELD_OUT = 5
"""Every fifth block is held out for the score."""
SHARED_DEG = {"yaw_deg": 0.1, "pitch_deg": 0.15, "roll_deg": 0.1}
"""Standard deviation of errors that all frames share and resampling cannot show: a detector draws the lower edge of
every car a few pixels too high or too low, and the LiDAR misses the sides of every car. Root mean square of the median
errors on KITTI 0009, KITTI 0052 and Astyx; those of any two of them cover the third within two standard deviations."""
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
        return {"model": self.model, **self.place_m, **self.values}

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
    found = search(table, model, progress, STEPS)
    if len(found[0].rows) < FEWEST_PAIRS:
        raise NothingToFit(_too_few(len(found[0].rows), len(table.boxes)))
    numbers = {scenes[k].t_ns // BLOCK_NS for k in train}
    views = [each for each in edges if each.t_ns // BLOCK_NS in numbers]
    rolls = _rolls(table, model, found[0].vector, views, progress)
    if rolls is not None:
        model = replace(model, roll_deg=(rolls.best_deg(), rolls.sigma_deg()))
        found = [refine(table, model, found[0].vector, GATES[-3:]), *found[1:]]
    by_edges: Mapping[str, float] | None = None
    if name == "angular":
        better = _found(table, model, most_overlap(table, model, found[0].vector))
    else:
        better, by_edges = _by_edges(table, model, found[0], views, progress)
    found = [better, *found[1:]]
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


def _by_edges(
    table: PairTable, model: FitModel, boxes: Found, views: Sequence[EdgeView], progress: Progress
) -> tuple[Found, Mapping[str, float] | None]:
    """The mount by depth edges with its standard deviations; that of the boxes and None where they contradict it."""
    edges = fit_edges(views, model, boxes.vector, lambda done: progress(_EDGES_FROM + done, STEPS))
    if edges is None:
        return boxes, None
    shared = np.array([SHARED_DEG["yaw_deg"], SHARED_DEG["pitch_deg"]])
    off = np.abs(_boxes_off(table, model, edges.vector)) / np.hypot(np.hypot(edges.sigmas[:2], shared), shared)
    if off.max() > AGREED_SIGMAS or explained(table, model, edges.vector) < AGREED * boxes.explained:
        return boxes, None
    return _found(table, model, edges.vector), dict(zip(model.unknowns, edges.sigmas.tolist(), strict=True))


def _found(table: PairTable, model: FitModel, vector: F64) -> Found:
    """A result that pairs do not ask for alone."""
    rows = table.matched(table.residuals(model.aligned(vector), GATES[-1][0]), GATES[-1][1])
    return Found(vector, rows, explained(table, model, vector))


def _boxes_off(table: PairTable, model: FitModel, vector: F64) -> F64:
    """(2,) yaw and pitch, degrees, by which the boxes would turn a mount, with its roll and place as they are: boxes
    hardly determine these, and where they are wrong, so are the boxes' yaw and pitch."""
    assert model.camera is not None
    camera = corrected(model.params(vector), model.camera)
    near = replace(model, camera=camera, offset=False, roll_deg=(0.0, _EXACT_DEG), place_m={})
    return refine(table, near, np.zeros(3), GATES[-3:]).vector[:2]


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
    shared = SHARED_DEG
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
        progress(_BOOTSTRAPS_FROM + number, STEPS)
        drawn = np.concatenate([blocks[k] for k in rng.integers(0, len(blocks), len(blocks))])
        if rolls is not None:
            roll_deg = rolls.best_deg(rng.integers(0, len(rolls.blocks), len(rolls.blocks)))
            model = replace(model, roll_deg=(roll_deg, model.roll_deg[1]))
        found.append(refine(table.taken(drawn), model, vector, GATES[-2:]).vector)
    return np.array(found)


def _rolls(
    table: PairTable, model: FitModel, vector: F64, edges: Sequence[EdgeView], progress: Progress
) -> RollScores | None:
    """How well edges match by roll; None for an angular model, and if no roll stands out."""
    if model.name != "pinhole":
        return None

    def with_roll(roll_deg: float) -> F64:
        start = np.array([*vector[:2], roll_deg, *vector[3:]])
        return refine(table, replace(model, roll_deg=(roll_deg, _EXACT_DEG)), start, GATES[-2:]).vector

    return roll_scores(edges, model, with_roll, lambda done: progress(_ROLLS_FROM + done, STEPS))


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
