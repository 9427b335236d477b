"""Statistics that a few outliers do not change."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_SIGMAS_PER_MEDIAN = 1.4826
"""Of a normal distribution: its standard deviation over the median distance from its middle."""


def mad_sigma(deviations: npt.NDArray[np.float64]) -> float:
    """Standard deviation of a normal distribution with this median absolute deviation. deviations: from its middle."""
    return _SIGMAS_PER_MEDIAN * float(np.median(np.abs(deviations)))
