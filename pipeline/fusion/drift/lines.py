"""Compares lane lines with the car's own motion and with the LiDAR's road: a witness that needs no vehicle ahead.

**Yaw.** Between two images, a line moves sideways at the rate of its slope, because the car drives along its own axis,
apart from the car's rotation. A camera that has turned to the left sees every line turned to the right, while lines
move sideways as before; the difference is the camera's yaw against the direction of travel. It contains how the LiDAR
is mounted in the car, which is constant and often unknown, so only a change counts.

**Pitch.** Lines are parallel on the road that the LiDAR measures, for one pitch of the camera only
(``pipeline.lanes.road_lines``). Both sensors are in this measurement, but not the car.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from pipeline.common.robust import mad_sigma
from pipeline.types import F64

AT_M = 12.0
"""Where lines are compared: in the middle of the paint that small cameras see, so that position and slope are known
best."""
SURE, BEYOND_M = 0.5, 3.0
"""Quality of a line that counts, and how far beyond ``AT_M`` it must be seen, since a slope at its end is uncertain."""
SAME_LINE_M = 0.5
"""A line this far from where it was expected is another one: a broken line or a kerb."""
SLOWEST_MPS = 3.0
"""At lower speeds a line moves less than it is uncertain."""
SHARPEST_PER_M = 0.002
"""Above this curvature of the way (R = 500 m), the side slip of a LiDAR 2 m ahead of the rear axle exceeds 0.2°."""
STANDING_M = 0.1
"""A car that drives less in a piece of time stands, and sees nothing new."""
LONGEST_GAP_S = 0.35
"""Lines of images farther apart are not compared."""
FEWEST_COMPARED = 4
"""Line comparisons in a piece of time that give a yaw."""
PLACE_M = 0.02
"""Standard deviation of the lines' position at the beginning and end of a piece of time, which is the beginning of the
next. In random traffic at 6 to 24 m/s, the yaw of a piece varies by 0.05° to 0.5°; this gives 0.2° to 0.5°."""
YAW_SIGMA_DEG = 0.15
"""Error of yaw that lasts for a piece of time (1 σ), besides the lines' positions: wheel tracks and cross wind."""
PITCH_SIGMA_DEG, HILL_M = 0.17, 50.0
"""Error of pitch by crests and dips (1 σ; 0.003 rad, as in ``pipeline.lanes.road_lines``), which is another one after
so many metres: the LiDAR's road is measured nearer than lines are seen."""
LASTING_DEG = (0.5, 0.15)
"""Errors of yaw and pitch that last (1 σ): the LiDAR's yaw in the car, as mounts are that nobody has measured; the
camber of the road."""
FEWEST_PIECES = 6
"""Pieces of time from which the scatter of the angle is known."""
_PIECE, _YAW, _YAW_SIGMA, _PITCH, _PITCH_SIGMA, _FRAMES = range(6)


class RoadLines(NamedTuple):
    """Lane lines of an image, before tracking, and the car's motion."""

    coefficients: F64
    """(L, 4) of y = c0 + c1 x + c2 x² + c3 x³, ego, metres, of the lines that are certain."""
    pitch_deg: float | None
    """Downward pitch of the camera for which they are parallel; None with fewer than two lines."""
    speed_mps: float | None
    """Of the car."""
    yaw_rate_radps: float | None
    """Of the car, positive to the left."""


class MeasuredLine(Protocol):
    """A line of one image (``pipeline.lanes.line_fit.FittedLine``)."""

    @property
    def coefficients(self) -> F64:
        """(4,) as in ``RoadLines``."""
        ...

    @property
    def quality(self) -> float:
        """0–1."""
        ...

    @property
    def x_min_m(self) -> float:
        """Nearest point."""
        ...

    @property
    def x_max_m(self) -> float:
        """Farthest point."""
        ...


class LineState(NamedTuple):
    """What lines have shown."""

    t_ns: int = 0
    """Of the last image with lines."""
    last: F64 = np.zeros((0, 2))
    """(L, 2) position and slope of its lines."""
    sums: tuple[float, float, float, int] = (0.0, 0.0, 0.0, 0)
    """Of the piece of time under way: metres that lines moved sideways beyond their slope, metres along them, metres
    driven, number of compared lines."""
    pitches: tuple[float, ...] = ()
    """Pitches of the piece of time under way."""
    pitch_way_m: float = 0.0
    """Metres driven while they were seen."""
    rows: F64 = np.zeros((0, 6))
    """(M, 6) of earlier pieces: piece, yaw and its standard deviation, pitch and its standard deviation, frames; NaN
    where there is none."""


class LineAngles(NamedTuple):
    """An angle in M pieces of time, degrees."""

    piece: F64
    """(M,) number of the piece."""
    values: F64
    """(M,) the angle in each piece."""
    sigma_deg: F64
    """(M,) of the piece's own error."""
    frames: F64
    """(M,) number of images."""


def of_measured(
    lines: Sequence[MeasuredLine], pitch_rad: float, speed_mps: float | None, yaw_rate_radps: float | None
) -> RoadLines:
    """Without the lines that are uncertain or do not reach across ``AT_M``. pitch_rad: for which they are parallel."""
    sure = [
        each.coefficients for each in lines if each.quality > SURE and each.x_min_m < AT_M < each.x_max_m - BEYOND_M
    ]
    pitch_deg = float(np.degrees(pitch_rad)) if len(sure) > 1 else None
    return RoadLines(np.array(sure).reshape(-1, 4), pitch_deg, speed_mps, yaw_rate_radps)


def noted(state: LineState, lines: RoadLines, t_ns: int) -> LineState:
    """With the lines of one image."""
    c0, c1, c2, c3 = lines.coefficients.T
    slope = c1 + AT_M * (2.0 * c2 + 3.0 * AT_M * c3)
    now = np.column_stack([c0 + AT_M * (c1 + AT_M * (c2 + AT_M * c3)), slope])
    moved, along, way, compared = state.sums
    dt_s, speed, turning = (t_ns - state.t_ns) / 1e9, lines.speed_mps, lines.yaw_rate_radps
    if speed is not None and speed > SLOWEST_MPS and turning is not None and 0.0 < dt_s < LONGEST_GAP_S:
        curvature, driven = turning / speed, speed * dt_s
        if abs(curvature) < SHARPEST_PER_M and len(state.last) and len(now):
            expected = state.last[:, 0] + driven * (state.last[:, 1] - AT_M * curvature)
            away = np.abs(now[:, None, 0] - expected[None])
            nearest = away.argmin(axis=1)
            same = away.min(axis=1) < SAME_LINE_M
            before = state.last[nearest[same]]
            by_slope = driven * ((now[same, 1] + before[:, 1]) / 2.0 - AT_M * curvature)
            count = int(same.sum())
            moved += float(np.sum(now[same, 0] - before[:, 0] - by_slope))
            along, way, compared = along + count * driven, way + min(count, 1) * driven, compared + count
    pitches, pitch_way_m = state.pitches, state.pitch_way_m
    if lines.pitch_deg is not None:
        pitches = (*pitches, lines.pitch_deg)
        pitch_way_m += speed * dt_s if speed is not None and 0.0 < dt_s < LONGEST_GAP_S else 0.0
    return LineState(t_ns, now, (moved, along, way, compared), pitches, pitch_way_m, state.rows)


def closed(state: LineState, piece: int, oldest: float) -> LineState:
    """With the means over the piece of time that has ended, and without those up to ``oldest``."""
    moved, along, way, compared = state.sums
    rows = state.rows[state.rows[:, _PIECE] > oldest]
    yaw, yaw_sigma, pitch, pitch_sigma = np.nan, np.nan, np.nan, np.nan
    if compared >= FEWEST_COMPARED:
        yaw = float(np.degrees(moved / along))
        yaw_sigma = float(np.hypot(YAW_SIGMA_DEG, np.degrees(np.sqrt(2.0) * PLACE_M / way)))
    if state.pitches and state.pitch_way_m > STANDING_M:
        pitch = float(np.mean(state.pitches))
        # a standing car sees the same stretch of road again and again, and a slow one hardly another
        pitch_sigma = PITCH_SIGMA_DEG * float(np.sqrt(max(HILL_M / state.pitch_way_m, 1.0)))
    if np.isfinite(yaw) or np.isfinite(pitch):
        rows = np.vstack([rows, [piece, yaw, yaw_sigma, pitch, pitch_sigma, max(len(state.pitches), 1)]])
    return LineState(state.t_ns, state.last, rows=rows)


def angles(state: LineState, axis: int) -> LineAngles:
    """axis: 0 for yaw, 1 for pitch."""
    value, sigma = ((_YAW, _YAW_SIGMA), (_PITCH, _PITCH_SIGMA))[axis]
    rows = state.rows[np.isfinite(state.rows[:, value])]
    values, sigma_deg = rows[:, value], rows[:, sigma]
    return LineAngles(rows[:, _PIECE], values, sigma_deg * _scatter(values, sigma_deg), rows[:, _FRAMES])


def _scatter(values: F64, sigma_deg: F64) -> float:
    """By how much the values of successive pieces differ more than their standard deviations explain; at least 1. How
    well lines are seen depends on the network, the paint and the weather: of two random roads at 20 m/s, the yaw of a
    piece varied by 0.2° on one and by 0.85° on the other. A turn of the camera changes one difference only."""
    if len(values) < FEWEST_PIECES:
        return 1.0
    steps = np.abs(np.diff(values)) / np.hypot(sigma_deg[1:], sigma_deg[:-1])
    return max(mad_sigma(steps), 1.0)
