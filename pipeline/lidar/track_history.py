"""Positions of tracks over the last sightings, and the motion that they prove."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.types import F64, I64

_SIDE_NOISE_M = 0.15
"""Minimum noise of a side: neighbouring rays of a VLP-16 are 0.1 m apart at 28 m, and a rounded corner adds as much."""
_SURE_SIGMAS = 2.0
_JUMPS_M, _STAYS_M = 0.5, 0.3
"""A side jumps if it is farther inside than expected by the first: three times its noise, and at 10 Hz more than the
body of a vehicle moves sideways. It stays within the second, twice its noise."""
_LASTS = 3
"""Sightings for which a part was there, so that its own appearance is no longer in the track's speed."""
_NARROW = 3
"""Sightings that may be of one vehicle, out of ten, are enough for its extent: that of a few rays may be too narrow."""


def recorded(history: F64, partner: I64, place: F64, clock_s: float, frames: int) -> F64:
    """(T, frames, 5) the history with this tick's sightings appended."""
    kept: F64 = np.full((len(history), frames, 5), np.nan)
    common = min(frames, history.shape[1])
    kept[:, frames - common :] = history[:, history.shape[1] - common :]
    rows = np.flatnonzero(partner >= 0)
    kept[rows, :-1] = kept[rows, 1:]
    kept[rows, -1, 0] = clock_s
    kept[rows, -1, 1:] = place[partner[rows]]
    return kept


def first_sightings(place: F64, clock_s: float, frames: int) -> F64:
    """(N, frames, 5) the histories of new tracks with one sighting, at the current time."""
    history: F64 = np.full((len(place), frames, 5), np.nan)
    history[:, -1, 0], history[:, -1, 1:] = clock_s, place
    return history


def side_that_stays(history: F64, lateral_mps: F64, now_s: float, sides: F64) -> F64:
    """(T,) of each footprint of which a part was cut off: how far its other side is from where it was expected, ego y,
    m. NaN for the others.

    history: (T, H, 5) up to the last sighting. lateral_mps: (T,) speeds along ego y. sides: (T, 2) the new minimum and
    maximum ego y. A part is cut off if one side jumps inwards of where the last three sightings had it, while the other
    stays: two pedestrians who were one cluster are two again, or the front of a crossing car disappears behind a parked
    one. The reference point jumps by up to half of that, but nothing has moved.

    A side that jumps outwards may be motion: of a car that appears from behind another one, the front moves first. If
    it jumps back at once, as a hedge's does, the one jump makes up for the other.
    """
    last = history[:, -_LASTS:]
    expected = last[:, :, 3:] + (lateral_mps[:, None] * (now_s - last[:, :, 0]))[:, :, None]
    low_m, high_m = (sides - expected[:, -1]).T
    is_low_cut = (sides[:, 0] - expected[:, :, 0].max(axis=1) > _JUMPS_M) & (np.abs(high_m) <= _STAYS_M)
    is_high_cut = (expected[:, :, 1].min(axis=1) - sides[:, 1] > _JUMPS_M) & (np.abs(low_m) <= _STAYS_M)
    return np.where(is_low_cut, high_m, np.where(is_high_cut, low_m, np.nan))


def slopes(history: F64) -> F64:
    """(T, C) speed in m/s from a least-squares line through each column of (T, H, 1 + C) ``t_s …``; NaN if all times
    are equal."""
    return np.asarray(_slopes(np.ascontiguousarray(history)))


def rigid_sideways(history: F64) -> F64:
    """(T,) lateral speed of each track as a whole along ego y, m/s, from its (H, 5) history: the speed common to both
    sides, minus what their scatter can explain; 0 if the sides move differently.

    A parked car's footprint grows while we pass, as more of its flank becomes visible: its reference point moves by
    metres, but one of its sides does not. If a car pulls out, both sides move.
    """
    return np.asarray(_common_speed(np.ascontiguousarray(history), _SURE_SIGMAS))


def steady_sides(history: F64, now_s: float, widest_m: float, sigmas: float = _SURE_SIGMAS) -> F64:
    """(T, 2) the lateral extent of each track now, right and left, ego y in metres: the median of the sightings in its
    (T, H, 5) history, each moved by the speed common to both sides, minus ``sigmas`` of its standard deviation.
    Sightings wider than ``widest_m`` count only if fewer than ``_NARROW`` others remain.

    A rigid body does not widen from one sweep to the next; a cluster does, by returns from what stands beside it. Along
    a row of parked cars it may do so in most sweeps of a second.
    """
    return np.asarray(_steady_sides(np.ascontiguousarray(history), now_s, widest_m, sigmas))


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    slopes(np.zeros((1, 2, 3)))
    rigid_sideways(np.zeros((1, 2, 5)))
    steady_sides(np.zeros((1, 2, 5)), 0.0, 1.0)


@numba.njit(cache=True, nogil=True)
def _slopes(history):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``slopes``."""
    out = np.full((len(history), history.shape[2] - 1), np.nan)
    for i in range(len(history)):
        known = np.flatnonzero(~np.isnan(history[i, :, 0]))
        t, spread = _centred(history[i], known, 0)
        for c in range(out.shape[1]):
            xy, _ = _centred(history[i], known, 1 + c)
            if spread > 0.0:
                out[i, c] = (t * xy).sum() / spread
    return out


@numba.njit(cache=True, nogil=True)
def _common_speed(history, sigmas):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``rigid_sideways``: the smaller speed of the two sides, minus ``sigmas`` of its standard deviation."""
    out = np.zeros(len(history))
    for i in range(len(history)):
        known = np.flatnonzero(~np.isnan(history[i, :, 0]))
        t, spread = _centred(history[i], known, 0)
        if not spread > 0.0:
            continue
        speed, sure = np.zeros(2), np.zeros(2)
        for c in range(2):
            y, _ = _centred(history[i], known, 3 + c)
            speed[c] = (t * y).sum() / spread
            residual = ((y - t * speed[c]) ** 2).sum() / max(len(known) - 2, 1)
            noise_m = np.sqrt(max(residual, _SIDE_NOISE_M**2))
            sure[c] = abs(speed[c]) - sigmas * (noise_m / np.sqrt(spread))
        if np.sign(speed[0]) == np.sign(speed[1]):
            out[i] = np.sign(speed[0]) * max(sure.min(), 0.0)
    return out


@numba.njit(cache=True, nogil=True)
def _steady_sides(history, now_s, widest_m, sigmas):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``steady_sides``."""
    out, speed = np.empty((len(history), 2)), _common_speed(history, sigmas)
    for i in range(len(history)):
        chosen = np.flatnonzero(history[i, :, 4] - history[i, :, 3] <= widest_m)
        if len(chosen) < _NARROW:
            chosen = np.arange(history.shape[1])
        for side in range(2):
            out[i, side] = np.nanmedian(history[i, chosen, 3 + side] + speed[i] * (now_s - history[i, chosen, 0]))
    return out


@numba.njit(cache=True, nogil=True)
def _centred(history, known, column):  # type: ignore[no-untyped-def]  # pragma: no cover
    """One column of (H, C) at the known rows, minus its mean, and the sum of its squares."""
    values = history[known, column]
    values = values - values.sum() / max(len(known), 1)
    return values, (values * values).sum()
