"""Decides from what vehicles have shown for some time whether the camera has turned, since when, and by which angle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.fusion.drift.estimate import AngleSightings, changes
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

SHARED_DEG = 0.12
"""Standard deviation of the errors that all vehicles share, such as a detector that draws every box too low: as
measured for fits to real drives (``calibration.alignment.fit.SHARED_DEG``, 0.1° in yaw and 0.15° in pitch)."""
LINE_WITNESSES = 2
"""Lane lines count as so many vehicles: they are judged by their own motion, not by pairs that may be wrong."""
LINES_BEFORE, LINES_AFTER, LINES_DENY = 6, 8, 2
"""Pieces of time with lines before and after a turn from which they can show it, and after it from which they can deny
it: a turn of the camera changes lines at once."""
DENIED_SIGMAS, FEWEST_DENIED = 3.0, 3
"""A yaw that lines deny is one of the LiDAR, or vehicles err together: it must be this much clearer, and shown by so
many vehicles."""
STEP_SIGMA_DEG, STEP_LINES_DEG = (0.1, 0.0), (0.05, 0.0)
"""Standard deviation of a step in yaw and pitch besides that of its estimate, and the same where lines show the step
too. In simulated drives without a turn (17 drives, 14 km), the step between 20 s before and after any moment varies by
0.18° in the yaw of vehicles where the estimate says 0.14°, since vehicles turn and others come before them. Lines, by
0.07° where it says 0.07°, have roads without camber there: with the camber of a real road, and with wind, the yaw
against the car's motion changes by about 0.05°. Steps in pitch, 0.085°, are smaller than the estimate's 0.092°."""


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
    by_lines: bool = False
    """Whether lane lines show it, too."""


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
    by_lines: Mask
    """(T,) whether lane lines show the turn, too."""
    sigmas: F64
    """(T,) the angle in standard deviations; 0 where it is not sound or too small."""

    def turn(self, sigmas: float) -> MountTurn | None:
        """The clearest turn of at least so many standard deviations."""
        k = int(np.argmax(self.sigmas))
        return self.at(k) if self.sigmas[k] > sigmas else None

    def at(self, k: int) -> MountTurn:
        """The turn at the k-th moment."""
        since = int(self.moments[k]) if k else None
        return MountTurn(
            float(self.angle_deg[k]), float(self.sigma_deg[k]), int(self.vehicles[k]), since, bool(self.by_lines[k])
        )

    def since(self, piece: int | None) -> MountTurn:
        """The estimate from a piece of time on."""
        return self.at(0 if piece is None else max(int(np.searchsorted(self.moments, piece, "right")) - 1, 0))


def judge(seen: AngleSightings, values: F64, axis: int) -> TurnEstimates:
    """values: (M,) angles of the sightings about an axis, degrees. axis: 0 for yaw, 1 for pitch.

    A turn is clear by its level or by its step. A level contains the errors that all vehicles share, and lines contain
    how the LiDAR is mounted in the car; a step contains neither, if enough was seen before. If lines deny the
    clearest step, only the level counts.
    """
    first, last = int(seen.piece[0]), int(seen.piece[-1])
    moments = np.concatenate([[first], np.arange(first + FIRST, last - 1, EVERY)])
    found = changes(seen, values, moments)
    is_after = (seen.piece[None] >= moments[:, None]).astype(np.float64)
    near = np.maximum(AGREE_DEG, AGREE_SHARE * np.abs(found.after))
    boxes = ~seen.is_line
    of_vehicle = np.equal.outer(seen.vehicle[boxes], np.unique(seen.vehicle[boxes])).astype(np.float64)
    of_track = np.equal.outer(seen.track[boxes], np.unique(seen.track[boxes])).astype(np.float64)
    weight = is_after[:, boxes] * seen.frames[boxes]
    frames = weight @ of_track
    timed = values[boxes] - found.time_s[:, None] * seen.rate_degps[boxes]
    shown = ((weight * timed) @ of_track) / np.maximum(frames, 1.0)
    counts = frames >= FEWEST_FRAMES
    agreeing = np.sum(counts & (np.abs(shown - found.after[:, None]) < near[:, None]), axis=1)
    vehicles = np.sum(counts, axis=1)
    pieces, earlier = is_after[:, boxes] @ of_vehicle, (1.0 - is_after[:, boxes]) @ of_vehicle
    followed = ((pieces >= LONG) | ((pieces >= AFTER) & (earlier >= BEFORE))).any(axis=1)
    lines = _lines(seen, values, is_after, found.after - found.before, near)
    agreeing, witnesses = agreeing + LINE_WITNESSES * lines.agree, vehicles + LINE_WITNESSES * lines.agree
    fewest = np.where(lines.deny, FEWEST_DENIED, np.where(followed, 1, 2))
    is_sound = (agreeing >= AGREEING_SHARE * witnesses) & (agreeing >= fewest)
    clear = np.abs(found.after) / np.hypot(found.after_sigma, SHARED_DEG)
    step = np.abs(found.after - found.before) / np.hypot(
        found.step_sigma, np.where(lines.agree, STEP_LINES_DEG[axis], STEP_SIGMA_DEG[axis])
    )
    step = np.where(is_sound & (np.abs(found.after - found.before) > SMALLEST_DEG), step, 0.0)
    step *= not lines.deny[int(step.argmax())]
    clear = np.maximum(clear, step)
    clear = clear - FEW_SIGMAS * np.maximum(FEW - witnesses, 0) - DENIED_SIGMAS * lines.deny
    clear = np.where(is_sound & (np.abs(found.after) > SMALLEST_DEG), clear, 0.0)
    return TurnEstimates(moments, found.after, found.after_sigma, vehicles, is_sound, lines.agree, clear)


class _Lines(NamedTuple):
    """What lane lines say about a turn at each of T moments."""

    agree: Mask
    """(T,) whether they show it, too."""
    deny: Mask
    """(T,) whether they show that it did not happen."""


def _lines(seen: AngleSightings, values: F64, is_after: F64, step: F64, near: F64) -> _Lines:
    """Only a change counts: the level contains how the LiDAR is mounted in the car."""
    after, before = is_after * seen.is_line, (1.0 - is_after) * seen.is_line
    many, few = after.sum(axis=1), before.sum(axis=1)
    shown = after @ values / np.maximum(many, 1.0) - before @ values / np.maximum(few, 1.0)
    same, known = np.abs(shown - step) < near, few >= LINES_BEFORE
    return _Lines(known & (many >= LINES_AFTER) & same, known & (many >= LINES_DENY) & ~same)
