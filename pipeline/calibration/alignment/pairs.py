"""Pairs clusters with boxes under an alignment, and measures the distances between their edges.

Distances are in standard deviations of a detector's box error, which grows with the box. A roof between two rings has
no error as long as the box also ends between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np

from pipeline.alignment.projection import Alignment, Angular
from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.scenes import ENDS, FitScene
from pipeline.types import F64, I64

BOX_NOISE, EDGE_PX = 0.05, 2.0
"""Error of a box's edge as a share of its side, and in pixels for small boxes (1 σ)."""
_LEFT, _TOP, _RIGHT, _BOTTOM = range(4)


@dataclass(frozen=True, eq=False)
class PairTable:
    """All boxes (B) and clusters (C) of several frames, and the pairs within the same frame (P)."""

    boxes: F64
    """(B, 4)."""
    whole: np.ndarray
    """(B, 4) bool."""
    outline: F64
    """(C, K, 3)."""
    roof: F64
    """(C, 3)."""
    foot: F64
    """(C, 3, 3)."""
    range_m: F64
    """(C,)."""
    box: I64
    """(P,) the pair's box; ascending."""
    cluster: I64
    """(P,) the pair's cluster."""
    frame: I64
    """(B,) the frame of each box."""

    @classmethod
    def of(cls, scenes: Sequence[FitScene]) -> PairTable:
        boxes = [len(each.boxes) for each in scenes]
        clusters = [len(each.outline) for each in scenes]
        first_box, first_cluster = np.cumsum([0, *boxes]), np.cumsum([0, *clusters])
        pairs = [
            (first_box[k] + i, first_cluster[k] + j)
            for k in range(len(scenes))
            for i in range(boxes[k])
            for j in range(clusters[k])
        ]
        box, cluster = np.ascontiguousarray(np.array(pairs, dtype=np.int64).reshape(-1, 2).T)
        joined = {
            name: np.concatenate([getattr(each, name) for each in scenes])
            for name in ("boxes", "whole", "outline", "roof", "foot", "range_m")
        }
        return cls(**joined, box=box, cluster=cluster, frame=np.repeat(np.arange(len(scenes)), boxes))

    def taken(self, frames: I64) -> PairTable:
        """Only the boxes of these frames; a frame given twice counts twice."""
        return self.only(np.concatenate([np.flatnonzero(self.frame[self.box] == frame) for frame in frames]))

    def only(self, rows: I64) -> PairTable:
        """Only these pairs, with the required data of their clusters."""
        used, cluster = np.unique(self.cluster[rows], return_inverse=True)
        parts = {name: getattr(self, name)[used] for name in ("outline", "roof", "foot", "range_m")}
        return replace(self, **parts, box=self.box[rows], cluster=cluster)

    @cached_property
    def _points(self) -> F64:
        """(C · K, 3) everything that is projected; what is not known is somewhere ahead."""
        points = np.concatenate([self.outline, self.roof[:, None], self.foot], axis=1).reshape(-1, 3)
        return np.where(np.isfinite(points[:, 0])[:, None], points, 1.0)

    @cached_property
    def _has_roof(self) -> np.ndarray:
        """(C,) bool, whether there is a ring above."""
        return np.isfinite(self.roof[:, 0])

    @cached_property
    def _noise(self) -> F64:
        """(2, P) error of each pair's box across and down, pixels (1 σ)."""
        return np.asarray(np.hypot(BOX_NOISE * (self.boxes[:, 2:] - self.boxes[:, :2])[self.box].T, EDGE_PX))

    def extents(self, aligned: Alignment) -> F64:
        """(C, 5) left, right, lowest and highest possible roof (−inf if there is no ring above), foot; pixels. NaN
        behind the camera."""
        uv = aligned.project(self._points).reshape(len(self.outline), -1, 2)
        found = np.empty((len(uv), 5))
        _extents(uv, self._has_roof, found)
        return found

    def deviations(self, widen: float, slack_px: float) -> tuple[F64, F64]:
        """(P,) and (P,) standard deviations of a box's vertical and horizontal edges, pixels."""
        across, down = np.hypot(self._noise * widen, slack_px)
        return across, down

    def residuals(self, aligned: Alignment, widen: float = 1.0, slack_px: float = 0.0) -> F64:
        """(P, 4) deviation of the left, top, right and bottom of each pair's cluster from its box, in standard
        deviations; 0 for an edge without information. widen, slack_px: increase the standard deviation, for a search
        that is still far off."""
        across, down = self.deviations(widen, slack_px)
        off = np.empty((len(self.box), 4))
        _residuals(self.extents(aligned), self.boxes, self.whole, self.box, self.cluster, across, down, off)
        return off

    def matched(self, off: F64, gate: float) -> I64:
        """Rows of the matched pairs: mutually nearest boxes and clusters within ``gate`` (root mean square of the
        deviations). off: (P, 4) residuals."""
        distance = np.sqrt(np.mean(off**2, axis=1))
        best_of_box = np.full(len(self.boxes), np.inf)
        best_of_cluster = np.full(len(self.outline), np.inf)
        np.minimum.at(best_of_box, self.box, distance)
        np.minimum.at(best_of_cluster, self.cluster, distance)
        is_best = (distance <= best_of_box[self.box]) & (distance <= best_of_cluster[self.cluster])
        return np.flatnonzero(is_best & (distance < gate))

    def overlap(self, aligned: Alignment) -> F64:
        """(P,) IoU of each pair's box and projected cluster. A roof between two rings is taken from the box."""
        left, right, low, high, foot = self.extents(aligned)[self.cluster].T
        x1, y1, x2, y2 = self.boxes[self.box].T
        top = np.clip(y1, high, low)
        across = np.maximum(np.minimum(right, x2) - np.maximum(left, x1), 0.0)
        down = np.maximum(np.minimum(foot, y2) - np.maximum(top, y1), 0.0)
        both = across * down
        return np.nan_to_num(both / ((right - left) * (foot - top) + (x2 - x1) * (y2 - y1) - both))


def coarse_scores(table: PairTable, model: FitModel, grid: F64, widen: float, slack_px: float) -> F64:
    """(K,) score of each vector: number of boxes with a matching cluster, weighted by the quality of the match. The
    table's pairs must be sorted by box."""
    corners = replace(table, outline=np.ascontiguousarray(table.outline[:, :ENDS]))
    across, down = table.deviations(widen, slack_px)
    boxes, whole = table.boxes[table.box], table.whole[table.box]
    extents = angular_extents(corners) if model.name == "angular" else corners.extents
    return np.array(
        [
            _covered(extents(model.aligned(vector)), table.box, table.cluster, boxes, whole, across, down)
            for vector in grid
        ]
    )


def angular_extents(table: PairTable) -> Callable[[Alignment], F64]:
    """``table.extents`` of many angular models, the same to the last bit without projecting again: directions do not
    depend on the model, and pixels only grow with angles, so that the outermost points are those of any model."""
    directions = table.extents(Angular(1.0, 1.0, 0.0, 0.0))

    def extents(aligned: Alignment) -> F64:
        assert isinstance(aligned, Angular)
        pixels = np.empty_like(directions)
        pixels[:, :2] = aligned.cx + directions[:, :2] / aligned.h_res_rad
        pixels[:, 2:] = aligned.cy + directions[:, 2:] / aligned.v_res_rad
        return pixels

    return extents


@numba.njit(cache=True, nogil=True)
def _extents(uv, has_roof, found):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``PairTable.extents``. uv: (C, K + 4, 2) pixels of outline, roof and feet."""
    for c in range(len(uv)):
        left, right, low, foot, is_seen = np.inf, -np.inf, np.inf, -np.inf, True
        for k in range(uv.shape[1] - 4):
            u, v = uv[c, k]
            is_seen = is_seen and u == u and v == v
            left, right, low = min(left, u), max(right, u), min(low, v)
        is_seen_below = True
        for k in range(uv.shape[1] - 3, uv.shape[1]):
            v = uv[c, k, 1]
            is_seen_below = is_seen_below and v == v
            foot = max(foot, v)
        high = -np.inf
        if has_roof[c]:
            roof = uv[c, -4, 1]
            high = min(roof, low) if roof == roof else np.nan
        found[c] = left, right, low, high if is_seen else np.nan, foot if is_seen_below else np.nan
        if not is_seen:
            found[c, :3] = np.nan


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _residuals(extents, boxes, whole, box, cluster, across, down, off):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``PairTable.residuals``."""
    for p in range(len(box)):
        left, right, low, high, foot = extents[cluster[p]]
        x1, y1, x2, y2 = boxes[box[p]]
        roof = low - y1 if y1 > low else high - y1 if y1 < high else 0.0
        off[p] = (left - x1) / across[p], roof / down[p], (right - x2) / across[p], (foot - y2) / down[p]
        for edge in range(4):
            if not whole[box[p], edge]:
                off[p, edge] = 0.0
            elif not np.isfinite(off[p, edge]):
                off[p, edge] = 1e3


@numba.njit(cache=True, nogil=True)
def _covered(extents, box, cluster, boxes, whole, across, down):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Sum over boxes of the overlap with their best cluster. extents: (C, 5). The rest: (P, …) of each pair."""
    total, best = 0.0, 0.0
    for p in range(len(box)):
        if p and box[p] != box[p - 1]:
            total, best = total + best, 0.0
        left, right, low, high, foot = extents[cluster[p]]
        x1, y1, x2, y2 = boxes[p]
        off = 0.0
        if whole[p, 0]:
            off += ((left - x1) / across[p]) ** 2
        if whole[p, 1]:
            off += (max(y1 - low, high - y1, 0.0) / down[p]) ** 2
        if whole[p, 2]:
            off += ((right - x2) / across[p]) ** 2
        if whole[p, 3]:
            off += ((foot - y2) / down[p]) ** 2
        fits = np.exp(-off / 8)
        if fits > best:  # false for NaN, behind the camera
            best = fits
    return total + best
