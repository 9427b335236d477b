"""Points on the road seen in earlier frames, moved to their current position."""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import F64
from pipeline.types import EgoState


def now_at(points: F64, ego: EgoState, dt_s: float) -> F64:
    """(N, 2) ego x, y of points fixed to the ground, from their positions ``dt_s`` ago. The car has since driven an arc
    given by its speed and yaw rate (straight if the yaw rate is unknown)."""
    turned, way = (ego.yaw_rate_radps or 0.0) * dt_s, ego.speed_mps * dt_s
    c, s = np.cos(turned), np.sin(turned)
    away = points - (way * np.cos(0.5 * turned), way * np.sin(0.5 * turned))
    return np.column_stack([away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s])
