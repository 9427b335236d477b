"""Lane lines for tests of the path."""

from __future__ import annotations

import numpy as np

from pipeline.types.lane import EgoLane, LaneLine, Side


def straight_lane(sigma_m: float = 0.05) -> EgoLane:
    """A straight lane, 3.5 m wide, with the same sigma everywhere."""

    def line(side: Side, y_m: float) -> LaneLine:
        covariance = np.diag([sigma_m**2, 1e-8, 1e-12, 1e-16])
        return LaneLine(side, np.array([y_m, 0.0, 0.0, 0.0]), covariance, 3.0, 60.0, 0.9, 0.0)

    return EgoLane(line("left", 1.75), line("right", -1.75), "test", 0.0, 0.0, 3.5, np.array([0.0, 0.0, -0.5]))
