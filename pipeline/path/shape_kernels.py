"""Compiled loops of ``pipeline.path.road_shape``."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz", "contract", "reassoc"})
def weigh_shapes(  # type: ignore[no-untyped-def]
    s,
    d,
    blocks,
    first,
    second,
    heading,
    bin_m,
    band_m,
    temper,
    heading0,
    bends,
    bend_sigma,
    heading_sigma,
    own,
    own_sigma,
    later_sigma,
    far_sigma,
    chance,
    clear_m,
    improbable,
):  # pragma: no cover
    """(H, U, W) probability of each shape, and the log-evidence of all.

    s, d, blocks: (N,) cells: distance along the line, to the left of it, and log-likelihood that no road leads through.
    first, second, heading: the shapes, as in ``road_shape.Grid``. heading0, bends: of the line itself. bend_sigma …
    far_sigma: as in ``road_shape.Prior``.
    """
    bins = int(2.0 * band_m / bin_m) + 3
    count, other = np.zeros(bins, np.int32), np.zeros(bins, np.int32)
    at = np.empty(len(s) + len(s) % 2, np.int32)
    by_chance = chance * max(len(s) / bins, 1.0)
    logs = np.log(np.maximum(np.arange(4 * len(s) + 8) / 4.0 - 0.5, 0.0) / by_chance + 1.0)
    out = np.empty((len(heading), len(first), len(second)))
    likeliest = np.inf
    for i in range(len(heading)):
        for j in range(len(first)):
            for k in range(len(second)):
                b = (second[k] - 4.0 * first[j] + 40.0 * heading[i]) / 32000.0
                a = (first[j] - 20.0 * heading[i] - 8000.0 * b) / 400.0
                prior = ((bends[1] + 2.0 * a + 60.0 * b) / bend_sigma) ** 2
                prior += ((bends[2] + 2.0 * a + 180.0 * b) / bend_sigma) ** 2
                prior += ((bends[1] + 2.0 * a + 60.0 * b - own) / later_sigma) ** 2
                prior += ((bends[2] + 2.0 * a + 180.0 * b - own) / far_sigma) ** 2
                prior += ((heading0 + heading[i]) / heading_sigma) ** 2
                prior += ((bends[0] + 2.0 * a + 18.0 * b - own) / own_sigma) ** 2
                out[i, j, k] = 0.5 * prior
                likeliest = min(likeliest, out[i, j, k])
    best = -np.inf
    s2, s3 = s * s, s * s * s
    per_m, middle, last = 1.0 / bin_m, band_m / bin_m + 1.0, bins - 1.0  # the outer bins collect cells outside the band
    for i in range(len(heading)):
        for j in range(len(first)):
            for k in range(len(second)):
                prior = out[i, j, k]
                if prior > likeliest + improbable:
                    out[i, j, k] = -np.inf
                    continue
                b = (second[k] - 4.0 * first[j] + 40.0 * heading[i]) / 32000.0
                a = (first[j] - 20.0 * heading[i] - 8000.0 * b) / 400.0
                blocked = 0.0
                for n in range(len(s)):
                    aside = d[n] - heading[i] * s[n] - a * s2[n] - b * s3[n]
                    blocked += blocks[n] if abs(aside) < clear_m else 0.0
                    at[n] = int(min(max(aside * per_m + middle, 0.0), last))
                count[:] = 0
                other[:] = 0
                for n in range(0, len(s) - 1, 2):  # two counts: otherwise each increment waits for the one before
                    count[at[n]] += 1
                    other[at[n + 1]] += 1
                if len(s) % 2:
                    count[at[len(s) - 1]] += 1
                for c in range(bins):
                    count[c] += other[c]
                total = -blocked
                for c in range(1, bins - 1):
                    if count[c]:
                        total += count[c] * logs[count[c - 1] + 2 * count[c] + count[c + 1]]
                out[i, j, k] = temper * total - prior
                best = max(best, out[i, j, k])
    whole = 0.0
    for i in range(len(heading)):
        for j in range(len(first)):
            for k in range(len(second)):
                out[i, j, k] = np.exp(out[i, j, k] - best)
                whole += out[i, j, k]
    return out / whole, best + np.log(whole)


@numba.njit(cache=True, nogil=True)
def moments(s, first, second, heading, weights, last_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(K,) mean and standard deviation of the shape's lateral offset at ``s``, straight beyond the last node. weights:
    (H, U, W) probability of each shape."""
    mean, square = np.zeros(3), np.zeros((3, 3))
    term = np.empty(3)
    for only_mean in (True, False):
        for i in range(len(heading)):
            for j in range(len(first)):
                for k in range(len(second)):
                    p = weights[i, j, k]
                    if p == 0.0:
                        continue
                    term[2] = (second[k] - 4.0 * first[j] + 40.0 * heading[i]) / 32000.0
                    term[1] = (first[j] - 20.0 * heading[i] - 8000.0 * term[2]) / 400.0
                    term[0] = heading[i]
                    for a in range(3):
                        if only_mean:
                            mean[a] += p * term[a]
                        else:
                            for b in range(3):
                                square[a, b] += p * (term[a] - mean[a]) * (term[b] - mean[b])
    out, sigma, row = np.zeros(len(s)), np.empty(len(s)), np.empty(3)
    for n in range(len(s)):
        near = min(s[n], last_m)
        over = s[n] - near
        row[0], row[1] = near + over, near * near + 2.0 * near * over
        row[2] = near * near * near + 3.0 * near * near * over
        variance = 0.0
        for a in range(3):
            out[n] += mean[a] * row[a]
            for b in range(3):
                variance += row[a] * square[a, b] * row[b]
        sigma[n] = np.sqrt(max(variance, 0.0))
    return out, sigma
