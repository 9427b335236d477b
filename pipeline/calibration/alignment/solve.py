"""From the best mount by boxes to the best one at all: its roll, its depth edges, and the lens that it needs.

Boxes see a wrong focal length only from 5 % on, because a detector's boxes are some per cent too large or too small
everywhere. Depth edges see 1 %. A wrong focal length that is not noticed turns the mount, too: 2.5 % of it are 2° of
roll on KITTI 0052 and 0.4° of yaw on KITTI 0009, with far too small standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import corrected
from pipeline.calibration.alignment.doubts import Found
from pipeline.calibration.alignment.edge_fit import STEPS as EDGE_STEPS
from pipeline.calibration.alignment.edge_fit import fit_edges
from pipeline.calibration.alignment.edges import ROLL_STEPS, EdgeView, RollScores, roll_scores
from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.overlaps import most_overlap
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.search import GATES, SEARCH_STEPS, explained, refine, search
from pipeline.common.progress import Progress
from pipeline.types import F64

_EXACT_DEG = 0.01
"""Standard deviation that holds a roll in place."""
_ONE_LENS = SEARCH_STEPS + ROLL_STEPS + EDGE_STEPS
SOLVE_STEPS = 2 * _ONE_LENS
"""Number of progress steps of ``solve``."""
AGREED = 0.8
"""Share of what the boxes' mount explains that the edges' mount has to explain too. The boxes' shared error of some per
cent of their sides costs less than that; a mount that lies on other edges pairs fewer vehicles."""
AGREED_SIGMAS = 2.0
"""Largest turn in yaw and pitch that boxes ask for at the edges' mount, in standard deviations of both, with shared
errors. Where few edges end above or below, as in drawn images, edges put the pitch half a degree off."""
SHARED_DEG = {"yaw_deg": 0.1, "pitch_deg": 0.15, "roll_deg": 0.1}
"""Standard deviation of errors that all frames share and resampling cannot show: a detector draws the lower edge of
every car a few pixels too high or too low, and the LiDAR misses the sides of every car. Root mean square of the median
errors on KITTI 0009, KITTI 0052 and Astyx; those of any two of them cover the third within two standard deviations."""
SHARED_WITH_PLACE = SHARED_DEG | {"pitch_deg": 0.28, "left_m": 0.045, "up_m": 0.045}
"""The same for a fit of the position, too: a few centimetres of height look like some tenths of a degree of pitch, the
more so the less distances differ."""
SHARED_ZOOM = 0.006
"""The same for the focal length by edges: it is 0.4 %, 0.0 % and 0.9 % from the three calibrations."""
LENS_SIGMAS = 2.0
"""Standard deviations from which edges say that the calibration's focal length is wrong."""
LENS_GAIN = 1.1
"""The same by boxes alone: factor on what is explained. On the three recordings, 10 to 40 frames, a free focal length
explains 0.97 to 1.07 of what the right one does; one wrong by 5 % makes it 1.16 and more."""


class Solved(NamedTuple):
    """What a model gave."""

    model: FitModel
    """With what is known of the roll, and with or without a focal length to fit."""
    found: list[Found]
    """The best first; the others are candidates of the search."""
    by_edges: Mapping[str, float] | None
    """Standard deviations by name, if depth edges determine the result; None if boxes do."""
    rolls: RollScores | None
    """How well edges match by roll, if one stands out."""


def solve(table: PairTable, views: Sequence[EdgeView], model: FitModel, progress: Progress, steps: int) -> Solved:
    """The best result of a model; a pinhole model's with the calibration's focal length unless that is clearly wrong.
    steps: of the whole fit, for the progress; this part takes ``SOLVE_STEPS``."""
    if model.name == "angular":
        found = search(table, model, progress, steps)
        best = found_at(table, model, most_overlap(table, model, found[0].vector))
        return Solved(model, [best, *found[1:]], None, None)
    kept = search(table, model, progress, steps)

    def later(done: int, whole: int) -> None:
        progress(SEARCH_STEPS + done, whole)

    free = _with_edges(table, views, replace(model, zoom=None), later, steps)
    if _is_other_lens(free, kept[0].explained):
        return free
    return _with_edges(table, views, model, lambda done, whole: progress(_ONE_LENS + done, whole), steps, kept)


def found_at(table: PairTable, model: FitModel, vector: F64) -> Found:
    """A result that pairs do not ask for alone."""
    rows = table.matched(table.residuals(model.aligned(vector), GATES[-1][0]), GATES[-1][1])
    return Found(vector, rows, explained(table, model, vector))


def _is_other_lens(free: Solved, explained_with_given: float) -> bool:
    """Whether a fit with a free focal length shows that the given one is wrong."""
    if free.by_edges is None:
        return free.found[0].explained > LENS_GAIN * explained_with_given
    sigma = float(np.hypot(free.by_edges["zoom"], SHARED_ZOOM))
    return bool(abs(free.found[0].vector[-1]) > LENS_SIGMAS * sigma)


def _with_edges(
    table: PairTable,
    views: Sequence[EdgeView],
    model: FitModel,
    progress: Progress,
    steps: int,
    found: list[Found] | None = None,
) -> Solved:
    """The search, unless its results are given, then the roll and all of the mount by edges."""
    found = search(table, model, progress, steps) if found is None else found
    rolls = _rolls(table, model, found[0].vector, views, lambda done: progress(SEARCH_STEPS + done, steps))
    best = found[0]
    if rolls is not None:
        model = replace(model, roll_deg=(rolls.best_deg(), rolls.sigma_deg()))
        best = refine(table, model, best.vector, GATES[-3:])
    edges = fit_edges(views, model, best.vector, lambda done: progress(SEARCH_STEPS + ROLL_STEPS + done, steps))
    by_edges: Mapping[str, float] | None = None
    if edges is not None and _agree(table, model, edges.vector, edges.sigmas, best):
        best = found_at(table, model, edges.vector)
        by_edges = dict(zip(model.unknowns, edges.sigmas.tolist(), strict=True))
    return Solved(model, [best, *found[1:]], by_edges, rolls)


def _agree(table: PairTable, model: FitModel, vector: F64, sigmas: F64, boxes: Found) -> bool:
    """Whether boxes do not contradict the mount by depth edges."""
    shared = np.array([SHARED_DEG["yaw_deg"], SHARED_DEG["pitch_deg"]])
    off = np.abs(boxes_off(table, model, vector, GATES[-3:]).vector[:2]) / np.hypot(
        np.hypot(sigmas[:2], shared), shared
    )
    return bool(off.max() <= AGREED_SIGMAS and explained(table, model, vector) >= AGREED * boxes.explained)


def boxes_off(table: PairTable, model: FitModel, vector: F64, gates: Sequence[tuple[float, float]] = GATES) -> Found:
    """By which yaw and pitch, the first two numbers, in degrees, boxes would turn a mount, with its roll, place and
    lens as they are: boxes hardly determine these, and where they are wrong, so are the boxes' yaw and pitch. gates: as
    for ``refine``; all of them for a mount that may be some degrees off."""
    assert model.camera is not None
    camera = corrected(model.params(vector), model.camera)
    near = replace(model, camera=camera, offset=False, roll_deg=(0.0, _EXACT_DEG), place_m={}, zoom=1.0)
    return refine(table, near, np.zeros(3), gates)


def _rolls(
    table: PairTable, model: FitModel, vector: F64, edges: Sequence[EdgeView], progress: Callable[[int], object]
) -> RollScores | None:
    """How well edges match by roll; None if no roll stands out."""

    def with_roll(roll_deg: float) -> F64:
        start = np.array([*vector[:2], roll_deg, *vector[3:]])
        return refine(table, replace(model, roll_deg=(roll_deg, _EXACT_DEG)), start, GATES[-2:]).vector

    return roll_scores(edges, model, with_roll, progress)
