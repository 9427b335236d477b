"""Detects whether camera or LiDAR has been turned, and by which angle, from vehicles that both sensors see.

A vehicle's projected cuboid should coincide with its box. If it does not, the mounts are turned relative to the
calibration. Errors of single boxes are large and the same in every frame: a detector that draws one car too wide
continues to do so. Each vehicle therefore counts once, by the mean over its frames, with the standard deviation of such
means; and angles are reported only when the vehicles of the last seconds together leave little doubt.

It does not detect a wrong distance law, which moves no box, or a bend in the road, which moves both. A time offset
between the sensors moves each vehicle by the rate of its bearing; it is fitted together with the angle and held near
zero.
"""

from __future__ import annotations

from math import degrees, hypot
from typing import NamedTuple

import numba
import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.geometry import corners_of
from pipeline.fusion.fuse import Fusion
from pipeline.params import FusionParams
from pipeline.types import VEHICLES, Box, FusedObject

BORDER_PX = 3.0
"""A box this close to the image's border counts as cut: its border is where the image ends, not where the vehicle
does."""
LIKE_WIDTH, NARROWEST = 0.35, 0.4
"""A cluster whose width differs from that of its box by a larger share than the first covers a part of the vehicle, or
more than the vehicle. Beside the camera's axis, where the cluster may lack the vehicle's side, a width of at least the
second share of the box's is accepted."""
NARROWEST_M = 1.3
"""Narrower than any car: such a cluster is the visible part of a vehicle behind others, whereas a detector draws the
box of the whole vehicle."""
NEAREST_M, FARTHEST_M = 5.0, 40.0
"""Closer, the two mounts see different sides of a car; farther, only one or two rings hit it."""
LASTING_SHARE = 0.06
"""Constant error of the middle or lower edge of a vehicle's box, as a share of the box height (1 σ). Measured on Astyx
and KITTI with YOLOX-nano: the means of the 10 vehicles seen in at least five frames scatter by 0.063 sideways and 0.025
vertically (1.48 times the median absolute deviation)."""
LASTING_DEG = 0.12
"""Constant error of a cluster (1 σ): its sides lie between beams 0.2° to 0.4° apart, so each is off by up to that."""
FRAME_SHARE = 0.08
"""Additional error in each frame, as a share of the box height (1 σ). Measured as above: 0.046 sideways and 0.025
vertically in the median vehicle, 0.14 sideways for parked cars."""
SMALLEST_DEG = 0.4
"""Smaller angles are not reported: they move a car 30 m away by 0.2 m, about a tenth of its width, which fusion
tolerates."""
FEWEST_FRAMES, FEWEST_VEHICLES = 5, 3
"""A vehicle counts after five frames, half a second at 10 Hz. Three vehicles are needed, since of two both may be wrong
pairs."""
REMEMBERED = 20
"""Number of frames in a vehicle's running mean, two seconds at 10 Hz, so that a lead followed for minutes is judged by
its last seconds."""
FASTEST_DEGPS = 6.0
"""Vehicles whose bearing changes faster are being passed, so they are seen from another side in every frame."""
RECENT_SHARE = 0.4
"""Share of the time window that is also judged alone, so that vehicles from before a knock do not outvote those after
it."""
TIME_SIGMA_S = 0.04
"""Expected time offset between the sensors (1 σ): one image of a camera at 25 to 30 Hz. For vehicles whose bearing
changes fast, such as oncoming ones, a time offset looks like an angle; if all vehicles are of this kind, no angle can
be determined."""
HUBER, ROUNDS = 1.5, 10
"""Number of standard deviations beyond which a vehicle gets less weight (close to Huber's usual 1.345), and number of
re-weighting rounds."""
AGREEING_SHARE = 0.7
"""Share of the vehicles that must each show at least half of the angle: with three vehicles all of them, with four
three."""


class CuboidOffset(NamedTuple):
    """Measured offset between one vehicle's cuboid and its box."""

    id: int
    """Of the fused object."""
    t_ns: int
    """The last frame in which both were seen."""
    frames: int
    """Number of frames in which both sensors have seen it."""
    yaw_deg: float
    """Mean over the frames: the camera rotation to the left that would align the two."""
    pitch_deg: float
    """The same for rotation downwards."""
    height_deg: float
    """Height of the box, mean over the frames."""
    rate_degps: float = 0.0
    """Rate of change of its bearing, positive to the left, mean over the frames."""


class Drift(NamedTuple):
    """Rotation of the camera relative to its calibration."""

    yaw_deg: float
    """To the left."""
    pitch_deg: float
    """Downwards."""
    yaw_sigma_deg: float
    """Standard deviation of ``yaw_deg``."""
    pitch_sigma_deg: float
    """Standard deviation of ``pitch_deg``."""
    vehicles: int
    """Number of vehicles that it was estimated from."""

    @property
    def note(self) -> str:
        """A sentence for the user, with the remedy."""
        yaw = f"yaw {self.yaw_deg:+.1f}° ± {self.yaw_sigma_deg:.1f}°"
        pitch = f"pitch {self.pitch_deg:+.1f}° ± {self.pitch_sigma_deg:.1f}°"
        who = f"judging by {self.vehicles} vehicles"
        return f"Camera or LiDAR has turned, {who}: {yaw}, {pitch}. Check with Align, then Fit."


class DriftState(NamedTuple):
    """The vehicles of the last few seconds."""

    sightings: tuple[CuboidOffset, ...] = ()
    """One per vehicle; one not seen for ``fusion.drift_s`` is dropped."""


def follow(
    state: DriftState,
    fused: Fusion,
    aligned: Alignment | None,
    image_size: tuple[int, int] | None,
    t_ns: int,
    params: FusionParams,
) -> tuple[DriftState, Drift | None]:
    """The state after this frame, and the angles if they are significant; None otherwise."""
    if aligned is None or image_size is None:
        return DriftState(), None
    # Each vehicle gives the angle between its box and its projected cuboid; all vehicles of the last seconds are
    # evaluated together
    known = {each.id: each for each in state.sightings if t_ns - each.t_ns <= params.drift_s * 1e9}
    for item, found in _angles(fused, image_size, aligned):
        rate_degps = _rate_degps(item)
        if abs(rate_degps) < FASTEST_DEGPS:
            known[item.id] = _with(known.get(item.id), item.id, t_ns, (*found, rate_degps))
    sightings = tuple(known.values())
    return DriftState(sightings), judge(sightings, params)


def judge(sightings: tuple[CuboidOffset, ...], params: FusionParams) -> Drift | None:
    """The angles estimated from all sightings, or from the newest ones, if they differ significantly from zero."""
    newest_ns = max((each.t_ns for each in sightings), default=0)
    recent = tuple(each for each in sightings if newest_ns - each.t_ns <= RECENT_SHARE * params.drift_s * 1e9)
    whole = _judged(sightings, params)
    return whole if whole is not None or len(recent) == len(sightings) else _judged(recent, params)


def _judged(sightings: tuple[CuboidOffset, ...], params: FusionParams) -> Drift | None:
    steady = [each for each in sightings if each.frames >= FEWEST_FRAMES]
    if len(steady) < FEWEST_VEHICLES:
        return None
    sigmas_deg = np.array([_sigma_deg(each) for each in steady])
    rates = np.array([each.rate_degps for each in steady])
    yaws, pitches = (np.array([getattr(each, name) for each in steady]) for name in ("yaw_deg", "pitch_deg"))
    yaw_deg, yaw_sigma_deg, yaw_clear = _common(yaws, sigmas_deg, rates)
    pitch_deg, pitch_sigma_deg, pitch_clear = _common(pitches, sigmas_deg, np.zeros(len(steady)))
    found = ((yaw_deg, yaw_sigma_deg, yaw_clear), (pitch_deg, pitch_sigma_deg, pitch_clear))
    if not any(
        is_clear and abs(angle) > max(SMALLEST_DEG, params.drift_sigmas * sigma) for angle, sigma, is_clear in found
    ):
        return None
    return Drift(yaw_deg, pitch_deg, yaw_sigma_deg, pitch_sigma_deg, len(steady))


def _tells(item: FusedObject, box: Box, size: tuple[int, int]) -> bool:
    """Whether both sensors see the whole vehicle in this frame."""
    if item.cuboid is None or not item.seen_by_two_sensors or item.label not in VEHICLES:
        return False
    if item.cuboid.size[1] < NARROWEST_M:
        return False
    is_whole = min(box[0], box[1], size[0] - box[2], size[1] - box[3]) > BORDER_PX
    return is_whole and item.distance_m is not None and NEAREST_M <= item.distance_m <= FARTHEST_M


def _angles(
    fused: Fusion, image_size: tuple[int, int], aligned: Alignment
) -> list[tuple[FusedObject, tuple[float, float, float]]]:
    """Each object whose cuboid and box tell something, with yaw and pitch between the two and the box's height,
    degrees."""
    boxes = fused.vision_boxes
    asked = [(item, boxes[item.id]) for item in fused.objects if item.id in boxes]
    asked = [(item, box) for item, box in asked if _tells(item, box, image_size)]
    if not asked:
        return []
    corners = corners_of([item.cuboid for item, _ in asked if item.cuboid is not None])
    uv = aligned.project(corners.reshape(-1, 3)).reshape(-1, 8, 2)
    columns = (uv[:, :, 0].min(axis=1), uv[:, :, 0].max(axis=1), uv[:, :4, 1].max(axis=1))
    sides = (corners[:, :, 1].min(axis=1), corners[:, :, 1].max(axis=1))
    rows = np.column_stack([*columns, *sides, np.isnan(uv).any(axis=(1, 2))]).tolist()
    found, pixels = [], []
    for (item, box), (left, right, foot, low, high, is_behind) in zip(asked, rows, strict=True):
        edges = _edges(left, right, low, high, box) if not is_behind else None
        if edges is not None:
            found.append(item)
            pixels += [(edges[0], foot), (edges[1], box[3]), (edges[1], box[1])]
    if not found:
        return []
    x, y, z = aligned.rays(np.array(pixels))[1].T
    azimuth, elevation = np.arctan2(y, x).reshape(-1, 3), np.arctan2(z, np.hypot(x, y)).reshape(-1, 3)
    angles = np.degrees(
        np.column_stack(
            [
                azimuth[:, 0] - azimuth[:, 1],
                elevation[:, 1] - elevation[:, 0],
                elevation[:, 2] - elevation[:, 1],
            ]
        )
    )
    return [(item, (yaw, pitch, height)) for item, (yaw, pitch, height) in zip(found, angles.tolist(), strict=True)]


def _edges(left: float, right: float, low_m: float, high_m: float, box: Box) -> tuple[float, float] | None:
    """The columns to compare: of the projected cuboid (left, right) and of the box; None if their widths differ. low_m,
    high_m: ego y of the cuboid's sides.

    For a vehicle beside the camera's axis, the inner edge of the box is at the far end of the vehicle's side, which the
    LiDAR rarely hits; the outer edge is at the corner of its near face in both. For such a vehicle, only the outer edge
    is used.
    """
    share = (right - left) / (box[2] - box[0])
    if not NARROWEST < share < 1.0 + LIKE_WIDTH:
        return None
    if high_m < 0.0:
        return right, box[2]
    if low_m > 0.0:
        return left, box[0]
    if share > 1.0 - LIKE_WIDTH:
        return (left + right) / 2, (box[0] + box[2]) / 2
    return None


def _rate_degps(item: FusedObject) -> float:
    """Rate of change of its bearing, as far as its velocity is known."""
    if item.velocity_mps is None or item.cuboid is None:
        return 0.0
    (x, y, _), (vx, vy) = item.cuboid.center, item.velocity_mps
    return degrees((x * vy - y * vx) / max(x * x + y * y, 1.0))


def _with(before: CuboidOffset | None, number: int, t_ns: int, found: tuple[float, ...]) -> CuboidOffset:
    """The sighting with one more frame. found: values in the order of the fields after ``frames``."""
    if before is None:
        return CuboidOffset(number, t_ns, 1, *found)
    frames = min(before.frames + 1, REMEMBERED)
    means = (old + (new - old) / frames for old, new in zip(before[3:], found, strict=True))
    return CuboidOffset(number, t_ns, frames, *means)


def _sigma_deg(each: CuboidOffset) -> float:
    """Standard deviation of a vehicle's mean."""
    return hypot(LASTING_DEG, LASTING_SHARE * each.height_deg, FRAME_SHARE * each.height_deg / each.frames**0.5)


@numba.njit(cache=True, nogil=True)
def _common(values, sigmas, rates):  # type: ignore[no-untyped-def]  # pragma: no cover
    """The angle that all vehicles share besides a common time offset, its standard deviation, and whether most of the
    vehicles individually confirm it. Robust (Huber), so that a few wrong pairs have little effect. values, sigmas,
    rates: (N,) float64."""
    count = len(values)
    weight, off = sigmas**-2, np.zeros(count)
    shared, time_s, variance = 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        # The normal equations of angle + rate · time
        w, wr, wrr, right, right_r = 0.0, 0.0, TIME_SIGMA_S**-2, 0.0, 0.0
        for n in range(count):
            w += weight[n]
            wr += weight[n] * rates[n]
            wrr += weight[n] * rates[n] * rates[n]
            right += weight[n] * values[n]
            right_r += weight[n] * values[n] * rates[n]
        determinant = w * wrr - wr * wr
        shared, time_s = (wrr * right - wr * right_r) / determinant, (w * right_r - wr * right) / determinant
        variance = wrr / determinant
        for n in range(count):
            off[n] = abs(values[n] - shared - rates[n] * time_s) / sigmas[n]
            weight[n] = HUBER / max(off[n], HUBER) / sigmas[n] ** 2
    scatter, confirming = 0.0, 0
    for n in range(count):
        scatter += min(off[n], 2.0 * HUBER) ** 2
        confirming += (values[n] - rates[n] * time_s) * np.sign(shared) > abs(shared) / 2
    scatter = np.sqrt(scatter / max(count - 1, 1))
    return shared, np.sqrt(variance) * max(scatter, 1.0), confirming >= AGREEING_SHARE * count


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache."""
    _common(np.zeros(3), np.ones(3), np.zeros(3))
