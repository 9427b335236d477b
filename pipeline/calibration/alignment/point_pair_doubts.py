"""Says what pairs picked by hand do not determine, and which of them to check."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.calibration.alignment.models import FitModel
from pipeline.common.errors import BadInput
from pipeline.types import F64

TOO_SCATTERED = 2.0
"""Pairs that scatter by more than this factor of what is expected are worth checking."""
UNDETERMINED = {"yaw_deg": 2.0, "pitch_deg": 2.0, "roll_deg": 3.0, "left_m": 0.3, "up_m": 0.3}
"""Standard deviations from which a pinhole parameter counts as not determined, if pairs scatter as expected."""
UNDETERMINED_SHARE = 0.1
"""The same for both resolutions of the angular model, as a share."""
UNDETERMINED_ORIGIN_DEG = 2.0
"""The same for its origin."""


class PairsRefused(BadInput):
    """Pairs that do not determine an alignment; the text says which pair is missing."""


def refuse_undetermined(model: FitModel, sigmas: F64) -> None:
    """PairsRefused where the pairs hardly determine a parameter. sigmas: (P,) of the vector, if pairs scatter as
    expected."""
    if model.name == "angular":
        limits = np.array([UNDETERMINED_SHARE, UNDETERMINED_SHARE, UNDETERMINED_ORIGIN_DEG, UNDETERMINED_ORIGIN_DEG])
    else:
        limits = np.array([UNDETERMINED[each] for each in model.unknowns])
    worst = int(np.argmax(sigmas / limits))
    if sigmas[worst] <= limits[worst]:
        return
    name = model.unknowns[worst]
    if model.name == "angular":
        where = "farther to the left or right" if name in ("h_res_deg", "cx_px") else "higher or lower in the image"
        raise PairsRefused(f"the pairs do not determine {name.rpartition('_')[0]}: add one {where}")
    if not model.offset:
        raise PairsRefused("the pairs do not determine the roll: add one far from the others in the image")
    raise PairsRefused(
        "the pairs do not tell the camera's position from its angles: add one that is much nearer or farther than the "
        "others, and one to the side, or do not fit the position"
    )


def refuse_at_bounds(model: FitModel, vector: F64) -> None:
    """PairsRefused for a solution at the end of what was searched."""
    low, high = model.bounds()
    at = np.flatnonzero((vector <= low) | (vector >= high))
    if len(at):
        name = model.unknowns[int(at[0])].rpartition("_")[0]
        raise PairsRefused(f"the pairs ask for more {name} than can be set: a pair, or the calibration, is wrong")


def warnings_of_pairs(off_px: F64, outliers: Sequence[int], scatter: float, is_checked: bool) -> list[str]:
    """Sentences for a person.

    off_px: (N,) distances of projected points from their pixels. outliers: indices of pairs that were left out.
    scatter: of the others, relative to what is expected. is_checked: whether there are more pairs than unknowns need.
    """
    found = [
        f"pair {k + 1} contradicts the others by {off_px[k]:.0f} px and is left out: check or remove it"
        if np.isfinite(off_px[k])
        else f"pair {k + 1} is not in front of the camera and is left out: remove it"
        for k in outliers
    ]
    if scatter > TOO_SCATTERED:
        worst = int(np.nanargmax(np.where(np.isin(np.arange(len(off_px)), outliers), np.nan, off_px)))
        found.append(f"the pairs contradict each other, pair {worst + 1} by {off_px[worst]:.0f} px: check them")
    if not is_checked:
        found.append("no pair checks the others: add one")
    return found
