"""Positions of tracks over the last sightings, and the motion that they prove."""

from __future__ import annotations

import numpy as np

from pipeline.types import F64, I64

_SIDE_NOISE_M = 0.15
"""Minimum noise of a side: neighbouring rays of a VLP-16 are 0.1 m apart at 28 m, and a rounded corner adds as much."""
_SURE_SIGMAS = 2.0


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


def slopes(history: F64) -> F64:
    """(T, C) speed in m/s from a least-squares line through each column of (T, H, 1 + C) ``t_s …``; NaN if all times
    are equal."""
    known = ~np.isnan(history[:, :, :1])
    table = np.where(known, history, 0.0)
    mean = table.sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1)
    t, xy = (table - mean)[:, :, :1] * known, (table - mean)[:, :, 1:]
    spread = np.sum(t * t, axis=1)
    return np.asarray(
        np.divide(
            np.sum(t * xy, axis=1), spread, out=np.full((len(history), table.shape[2] - 1), np.nan), where=spread > 0.0
        )
    )


def rigid_sideways(history: F64) -> F64:
    """(T,) lateral speed of each track as a whole along ego y, m/s, from its (H, 5) history: the speed common to both
    sides, minus what their scatter can explain; 0 if the sides move differently.

    A parked car's footprint grows while we pass, as more of its flank becomes visible: its reference point moves by
    metres, but one of its sides does not. If a car pulls out, both sides move.
    """
    if not len(history):
        return np.zeros(0)
    sides = history[:, :, [0, 3, 4]]
    speed = slopes(sides)
    known = ~np.isnan(sides[:, :, :1])
    count = np.maximum(known.sum(axis=1), 1)
    t = np.where(known, sides[:, :, :1], 0.0)
    t = (t - t.sum(axis=1, keepdims=True) / count[:, None]) * known
    y = np.where(known, sides[:, :, 1:], 0.0)
    y = (y - y.sum(axis=1, keepdims=True) / count[:, None]) * known
    residual = np.sum((y - t * np.nan_to_num(speed)[:, None, :]) ** 2, axis=1) / np.maximum(count - 2, 1)
    noise_m = np.sqrt(np.maximum(residual, _SIDE_NOISE_M**2))
    span = np.sqrt(np.sum(t * t, axis=1))
    sure = np.abs(speed) - _SURE_SIGMAS * np.divide(noise_m, span, out=np.full_like(noise_m, np.inf), where=span > 0.0)
    least = np.clip(np.nan_to_num(sure, nan=0.0, neginf=0.0).min(axis=1), 0.0, None)
    together = np.sign(speed[:, 0]) == np.sign(speed[:, 1])
    return np.asarray(np.where(together, np.sign(np.nan_to_num(speed[:, 0])) * least, 0.0))
