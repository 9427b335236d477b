"""Decides from what vehicles have shown for some time whether the camera has turned, since when, and by which angle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.fusion.drift.estimate import PairedBoxes, changes
from pipeline.types import F64, Mask

PIECE_S = 0.5
"""Length of the pieces of time over which a vehicle's angles are averaged."""
EVERY, FIRST = 4, 4
"""A turn is looked for at every so many pieces, and no earlier than so many after the first one."""
SMALLEST_DEG = 0.3
"""Smaller angles move a car 30 m away by less than a tenth of its width, which fusion tolerates."""
FEWEST_FRAMES = 5
"""A vehicle counts after half a second at 10 Hz."""
FEW, FEW_SIGMAS = 3, 0.5
"""For each vehicle that fewer vehicles than the first number lack, a turn must be this many standard deviations
clearer: the errors of a few vehicles may agree by chance."""
AGREE_DEG, AGREE_SHARE, AGREEING_SHARE = 0.35, 0.5, 0.7
"""A vehicle agrees with an angle within this angle, or within this share of it; share of the vehicles that must."""
BEFORE, AFTER, LONG = 6, 8, 20
"""A single vehicle is believed if it was seen in so many pieces before and after the turn, because its own error cannot
look like a turn then; or if it was seen in so many pieces, since a wrong pair does not last."""


class MountTurn(NamedTuple):
    """A turn about one axis."""

    angle_deg: float
    """From the calibration."""
    sigma_deg: float
    """Its standard deviation."""
    vehicles: int
    """Number of vehicles that it was estimated from."""
    since: int | None
    """Piece of time at which it happened; None if it was so from the beginning of what is remembered."""


class TurnEstimates(NamedTuple):
    """The estimates about one axis, one for each moment from which the camera may have been turned."""

    moments: np.ndarray
    """(T,) pieces of time, ascending; the first is the beginning."""
    angle_deg: F64
    """(T,)."""
    sigma_deg: F64
    """(T,)."""
    vehicles: np.ndarray
    """(T,) that were seen from then on."""
    is_sound: Mask
    """(T,) whether enough vehicles agree."""
    sigmas: F64
    """(T,) the angle in standard deviations; 0 where it is not sound or too small."""

    def turn(self, sigmas: float) -> MountTurn | None:
        """The clearest turn of at least so many standard deviations."""
        k = int(np.argmax(self.sigmas))
        return self.at(k) if self.sigmas[k] > sigmas else None

    def at(self, k: int) -> MountTurn:
        """The turn at the k-th moment."""
        since = int(self.moments[k]) if k else None
        return MountTurn(float(self.angle_deg[k]), float(self.sigma_deg[k]), int(self.vehicles[k]), since)

    def since(self, piece: int | None) -> MountTurn:
        """The estimate from a piece of time on."""
        return self.at(0 if piece is None else max(int(np.searchsorted(self.moments, piece, "right")) - 1, 0))


def judge(seen: PairedBoxes, values: F64) -> TurnEstimates:
    """values: (M,) angles of the sightings about one axis, degrees."""
    first, last = int(seen.piece[0]), int(seen.piece[-1])
    moments = np.concatenate([[first], np.arange(first + FIRST, last - 1, EVERY)])
    found = changes(seen, values, moments)
    of_vehicle = np.equal.outer(seen.vehicle, np.arange(int(seen.vehicle.max()) + 1)).astype(np.float64)
    is_after = (seen.piece[None] >= moments[:, None]).astype(np.float64)
    of_track = np.equal.outer(seen.track, np.arange(int(seen.track.max()) + 1)).astype(np.float64)
    frames = (is_after * seen.frames) @ of_track
    timed = values - found.time_s[:, None] * seen.rate_degps
    shown = ((is_after * seen.frames * timed) @ of_track) / np.maximum(frames, 1.0)
    counts = frames >= FEWEST_FRAMES
    near = np.maximum(AGREE_DEG, AGREE_SHARE * np.abs(found.after))
    agreeing = np.sum(counts & (np.abs(shown - found.after[:, None]) < near[:, None]), axis=1)
    vehicles = np.sum(counts, axis=1)
    pieces, earlier = is_after @ of_vehicle, (1.0 - is_after) @ of_vehicle
    followed = ((pieces >= LONG) | ((pieces >= AFTER) & (earlier >= BEFORE))).any(axis=1)
    is_sound = (agreeing >= AGREEING_SHARE * vehicles) & (agreeing >= np.where(followed, 1, 2))
    sigmas = np.abs(found.after) / found.after_sigma - FEW_SIGMAS * np.maximum(FEW - vehicles, 0)
    sigmas = np.where(is_sound & (np.abs(found.after) > SMALLEST_DEG), sigmas, 0.0)
    return TurnEstimates(moments, found.after, found.after_sigma, vehicles, is_sound, sigmas)
