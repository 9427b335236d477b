"""A made-up sweep for compiling kernels before the first frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def made_sweep() -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8]]:
    """Points (2, 4) and rings (2,)."""
    return np.ones((2, 4), np.float32), np.zeros(2, np.uint8)
