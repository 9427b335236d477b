"""Filling polygons of the ego frame into an image: projection, clipping at the near plane, daylight and haze.

Polygons are collected first, then shaded, projected and clipped together; an image has about a thousand of them.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.common.geometry import transform
from pipeline.simulation.drawing.lens import distorted
from pipeline.types import F64, I64, U8, CameraCalibration

NEAR_M = 0.4
HAZE_M = 420.0
HAZE_BGR = np.array([214.0, 200.0, 184.0])
SUN = np.array([-0.55, 0.45, 0.70])
"""Direction of the light, ego axes: from behind, the left and above; unit length."""
_SHIFT = 4  # OpenCV takes coordinates in 1/16 px
_FAR_OUTSIDE_PX = 20_000.0
_PIECE_PX, _MOST_PIECES = 160.0, 64  # an edge of 160 px in the image's corner is bent by a quarter of a pixel

Colour = tuple[float, float, float]
CanvasPoint = tuple[float, float, float]


def hazed(bgr: F64, distance_m: npt.ArrayLike) -> F64:
    """(…, 3) colours with the haze of a distance."""
    clear = np.exp(-np.asarray(distance_m, dtype=np.float64) / HAZE_M)[..., None]
    mixed: F64 = bgr * clear + HAZE_BGR * (1.0 - clear)
    return mixed


def lit(bgr: F64, normals: F64) -> F64:
    """(F, 3) colours of surfaces with (F, 3) normals in the ego frame: sun, sky light from above, ambient light.
    Colours with a zero normal are unchanged."""
    sun = np.maximum(normals @ SUN, 0.0)
    sky = 0.5 + 0.5 * normals[:, 2]
    shaded = np.minimum(bgr * (0.36 + 0.52 * sun + 0.30 * sky)[:, None] + 14.0 * sky[:, None], 255.0)
    return np.where(np.any(normals != 0.0, axis=1)[:, None], shaded, bgr)


class Canvas:
    """An image under a camera. ``add`` gathers polygons, ``paint`` fills them in the order they were added."""

    def __init__(self, bgr: U8, camera: CameraCalibration) -> None:
        self.bgr = bgr
        self._T = camera.T_camera_ego
        self._focal = np.array([camera.K[0, 0], camera.K[1, 1]])
        self._center = camera.K[:2, 2]
        self._distortion = camera.distortion
        self._clear()

    def _clear(self) -> None:
        self._points: list[F64] = []
        self._counts: list[I64] = []
        self._colours: list[F64] = []
        self._normals: list[F64] = []
        self._faces: list[tuple[tuple[CanvasPoint, ...], Colour, CanvasPoint]] = []

    def add(self, points: F64, counts: I64, colours: F64, normals: F64 | None = None) -> None:
        """Polygons: (V, 3) ego points, (P,) numbers of corners, (P, 3) colours and (P, 3) normals for shading. Without
        normals only haze is applied."""
        self._gather_faces()
        self._points.append(points)
        self._counts.append(counts)
        self._colours.append(colours)
        self._normals.append(np.zeros((len(counts), 3)) if normals is None else normals)

    def add_face(self, corners: tuple[CanvasPoint, ...], bgr: Colour, normal: CanvasPoint = (0.0, 0.0, 0.0)) -> None:
        """One polygon given corner by corner."""
        self._faces.append((corners, bgr, normal))

    def _gather_faces(self) -> None:
        """Turn single faces into arrays all at once; one by one this would cost more than filling them."""
        if not self._faces:
            return
        corners, colours, normals = zip(*self._faces, strict=True)
        self._faces = []
        self._points.append(np.array([point for face in corners for point in face]))
        self._counts.append(np.array([len(face) for face in corners]))
        self._colours.append(np.array(colours, dtype=np.float64))
        self._normals.append(np.array(normals, dtype=np.float64))

    def paint(self, haze: bool = True) -> None:
        """Shade, project and fill all collected polygons, and clear the collection."""
        self._gather_faces()
        if not self._points:
            return
        points, counts = transform(self._T, np.concatenate(self._points)), np.concatenate(self._counts)
        colours = lit(np.concatenate(self._colours), np.concatenate(self._normals))
        self._clear()
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        if haze:
            colours = hazed(colours, np.linalg.norm(np.add.reduceat(points, starts) / counts[:, None], axis=1))
        nearest, farthest = (f.reduceat(points[:, 2], starts) for f in (np.minimum, np.maximum))
        chosen = np.flatnonzero(farthest > NEAR_M)
        outlines = [points[start : start + count] for start, count in zip(starts[chosen], counts[chosen], strict=True)]
        for i in np.flatnonzero(nearest[chosen] < NEAR_M):
            outlines[i] = clip_near(outlines[i])
        self._fill(outlines, colours[chosen])

    def _fill(self, outlines: list[F64], colours: F64) -> None:
        """Fill (K, 3) polygons beyond the near plane, camera axes, in order."""
        if not outlines:
            return
        points, counts = np.concatenate(outlines), np.array([len(outline) for outline in outlines])
        flat, counts = self._fine_edges(points[:, :2] / points[:, 2:], counts)
        pixels = distorted(flat, self._distortion) * self._focal + self._center
        fixed = (np.clip(pixels, -_FAR_OUTSIDE_PX, _FAR_OUTSIDE_PX) * (1 << _SHIFT)).astype(np.int32)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        ends, starts_list, colour_list = (starts + counts).tolist(), starts.tolist(), colours.tolist()
        for i in np.flatnonzero(self._inside(fixed, starts)).tolist():
            cv2.fillPoly(self.bgr, [fixed[starts_list[i] : ends[i]]], colour_list[i], cv2.LINE_AA, _SHIFT)

    def _fine_edges(self, flat: F64, counts: I64) -> tuple[F64, I64]:
        """Subdivide long edges: lens distortion bends straight edges."""
        if not self._distortion.size:
            return flat, counts
        after = np.arange(1, len(flat) + 1)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        after[starts + counts - 1] = starts
        edge = flat[after] - flat
        length_px = np.hypot(edge[:, 0], edge[:, 1]) * self._focal[0]
        pieces = np.clip(np.ceil(length_px / _PIECE_PX), 1, _MOST_PIECES).astype(np.int64)
        first = np.cumsum(pieces) - pieces
        share = (np.arange(int(pieces.sum())) - np.repeat(first, pieces)) / np.repeat(pieces, pieces)
        fine = np.repeat(flat, pieces, axis=0) + share[:, None] * np.repeat(edge, pieces, axis=0)
        return fine, np.add.reduceat(pieces, starts)

    def _inside(self, fixed: npt.NDArray[np.int32], starts: I64) -> npt.NDArray[np.bool_]:
        """Which polygons touch the image and are not smaller than a fifth of a pixel."""
        low, high = np.minimum.reduceat(fixed, starts), np.maximum.reduceat(fixed, starts)
        size = np.array([self.bgr.shape[1], self.bgr.shape[0]]) << _SHIFT
        touches: npt.NDArray[np.bool_] = np.all((high >= 0) & (low <= size), axis=1) & np.any(high - low > 3, axis=1)
        return touches


def clip_near(polygon: F64) -> F64:
    """The part of a (K, 3) polygon, in camera axes, beyond the near plane (Sutherland and Hodgman 1974); empty if there
    is none."""
    after = np.roll(polygon, -1, axis=0)
    depth, depth_after = polygon[:, 2], after[:, 2]
    kept = depth >= NEAR_M
    cut = kept != (depth_after >= NEAR_M)
    share = (NEAR_M - depth) / np.where(cut, depth_after - depth, 1.0)
    both = np.stack([polygon, polygon + share[:, None] * (after - polygon)], axis=1)
    return np.asarray(both[np.column_stack([kept, cut])], dtype=np.float64)
