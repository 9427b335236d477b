"""Made-up sweeps for compiling kernels before the first frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt


def made_sweeps() -> Iterator[tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8]]]:
    """Points (2, 4) and rings (2,), writeable and not: for numba, read-only arrays, such as those read from a file, are
    another type, and deskewing makes new points but keeps the rings."""
    for points_writeable, ring_writeable in ((True, True), (False, False), (True, False)):
        points, ring = np.ones((2, 4), np.float32), np.zeros(2, np.uint8)
        points.flags.writeable, ring.flags.writeable = points_writeable, ring_writeable
        yield points, ring
