"""The lens of a calibration file or a ROS bag: OpenCV's polynomial, which ROS calls plumb_bob or
rational_polynomial."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.types import F64
from pipeline.types.source import SourceError

_POLYNOMIALS = ("plumb_bob", "rational_polynomial", "radtan", "none", "")
FISHEYE = "equidistant"
_FISHEYES = (FISHEYE, "fisheye", "kannala_brandt", "fov", "thin_prism_fisheye")
"""Another projection: without coefficients, it is no pinhole either."""
LENGTHS = (4, 5, 8)
"""Numbers of coefficients of the polynomial."""


def polynomial_lens(values: npt.ArrayLike, model: str, what: str) -> F64:
    """(0,), (4,), (5,) or (8,) float64 k1 k2 p1 p2 k3 k4 k5 k6 of ``cv2.projectPoints``; (0,) if all are zero.

    values: up to 14, of which those of a thin prism and a tilted sensor have to be zero. model: as the file calls it.
    what: begins the sentence of the SourceError for another model, another number of values or anything else.
    """
    try:
        given = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        given = np.empty((0, 0))
    if given.ndim != 1 or not np.all(np.isfinite(given)):
        raise SourceError(f"{what}: not a list of finite numbers")
    name = model.lower()
    if name in _FISHEYES or (np.any(given) and name not in _POLYNOMIALS):
        raise SourceError(f"{what}: {model} is not supported; calibrate as plumb_bob or rational_polynomial")
    if not np.any(given):
        return np.zeros(0)
    if len(given) in (12, 14):
        if np.any(given[8:]):
            raise SourceError(
                f"{what}: a thin prism or a tilted sensor is not supported; calibrate with 5 or 8 numbers"
            )
        given = given[:8]
    if len(given) not in LENGTHS:
        raise SourceError(f"{what}: {len(given)} distortion coefficients; 4, 5 or 8 are supported")
    return given
