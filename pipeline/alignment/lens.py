"""OpenCV's camera model, compiled: a mount, a pinhole, and radial, tangential and thin-prism distortion.

``cv2.projectPoints`` takes more than ten times as long for each of many points, and was most of a fit of the alignment.
Source: OpenCV 4, "Camera Calibration and 3D Reconstruction", detailed description.
"""

from __future__ import annotations

import cv2
import numba
import numpy as np

from pipeline.common.geometry import F64, transform

_COMPILED = 12
"""Coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4. Two more, of a tilted sensor, are left to OpenCV."""


def through_lens(points: F64, T_camera: F64, K: F64, distortion: F64, nearest_m: float) -> F64:
    """(N, 3) points, metres → (N, 2) pixels u, v; NaN for those less than ``nearest_m`` ahead of the camera.

    T_camera: (4, 4), takes the points to the camera frame. K: (3, 3). distortion: OpenCV's coefficients, empty without
    distortion.
    """
    rows = np.array(points, dtype=np.float64)  # copies have one layout, so that one compiled version does for all
    uv, coefficients = np.empty((len(rows), 2)), np.zeros(_COMPILED)
    if distortion.size > _COMPILED and np.any(distortion[_COMPILED:]):
        in_camera = transform(T_camera, rows)
        in_camera[in_camera[:, 2] < nearest_m] = np.nan
        if len(rows):  # OpenCV returns None for no points
            uv[:] = cv2.projectPoints(in_camera, np.zeros(3), np.zeros(3), K, distortion)[0].reshape(-1, 2)
        return uv
    coefficients[: min(distortion.size, _COMPILED)] = distortion.ravel()[:_COMPILED]
    _project(rows, np.array(T_camera), K[0, 0], K[1, 1], K[0, 2], K[1, 2], coefficients, nearest_m, uv)
    return uv


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _project(points, T, fx, fy, cx, cy, k, nearest_m, uv):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``through_lens``."""
    for n in range(len(points)):
        ego_x, ego_y, ego_z = points[n]
        z = T[2, 0] * ego_x + T[2, 1] * ego_y + T[2, 2] * ego_z + T[2, 3]
        if not z >= nearest_m:
            uv[n] = np.nan
            continue
        x = (T[0, 0] * ego_x + T[0, 1] * ego_y + T[0, 2] * ego_z + T[0, 3]) / z
        y = (T[1, 0] * ego_x + T[1, 1] * ego_y + T[1, 2] * ego_z + T[1, 3]) / z
        r2 = x * x + y * y
        radial = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])))
        bent_x = x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x) + r2 * (k[8] + r2 * k[9])
        bent_y = y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y + r2 * (k[10] + r2 * k[11])
        uv[n, 0], uv[n, 1] = fx * bent_x + cx, fy * bent_y + cy


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache."""
    through_lens(np.ones((1, 3)), np.eye(4), np.eye(3), np.zeros(0), 0.3)
