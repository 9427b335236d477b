"""Simulates the boxes of a detector of real images, without images: true vehicles with the errors in
``measured_noise.json``, and false positives.

Misses come in bursts. Edges have one error that is constant for a vehicle, one that changes slowly and one that is new
in each frame. The boxes of partly hidden vehicles leave out part of what is hidden. Scores fall with range, cars are
sometimes classified as trucks, and some vehicles have two boxes. A false box stands at a fixed position in the world,
so it grows as the car approaches, like a shop front. Everything is drawn per vehicle for the whole drive, so any frame
can be computed.

Assumed, not measured: scores, classes and doubles change over 3 s; misses are decided by a normal variable whose
correlation reproduces that of the measured misses at a probability of one half; beyond the last measured range, recall
halves every 15 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, exp, pi, radians, sin

import numpy as np

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.measured_noise import SHARES, MeasuredNoise, measured
from pipeline.simulation.sensors.series import lasting
from pipeline.simulation.sensors.truth_boxes import LABELS, LAW, VisibleVehicle, in_image
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, World
from pipeline.types import F64, CameraCalibration, RawBoxes

_FORGETS_S = 3.0
_WANDERS_S = 1.0
"""Time in which slow errors of edges change. On eight vehicles of KITTI 0009 that are followed for a second or more,
half to three quarters of their variance is new after 0.65 s, and all of it after 1.1 to 1.7 s."""
_HALVES_M = 15.0
_MISS, _SCORE, _CALLED, _DOUBLED, _EDGES = 0, 1, 2, 3, slice(4, 8)
_COLUMNS = 8
_LARGE = ("truck", "bus")
_CAR_HEIGHT_M = 1.48
_LONGEST_FALSE = 60
"""Maximum duration of a false box, in frames."""


@dataclass(frozen=True)
class FalseThing:
    """An object that is falsely detected as a vehicle."""

    number: int
    """Unique among the false objects of the drive."""
    first: int
    """First frame in which it is seen."""
    last: int
    """Last frame in which it is seen."""
    x: float
    """In the world, metres."""
    y: float
    """In the world, metres."""
    height_m: float
    """Of the box, at its position."""
    width: float
    """Of the box, as a share of its height."""
    score: float
    """The detector's, 0–1."""
    label: str
    """Detected class."""


class RealDetector:
    """The boxes of one scenario."""

    def __init__(self, scenario: Scenario, noise: MeasuredNoise | None = None) -> None:
        self._scenario, self._noise = scenario, noise or measured()
        self._frames = scenario.frame_count()
        self._series = lru_cache(maxsize=None)(self._draw)
        self._things = _false_things(scenario, self._noise)
        middles = np.array(self._noise.ranges_m)
        self._middles_m = (middles[:-1] + middles[1:]) / 2

    def boxes(self, now: World, camera: CameraCalibration, index: int) -> RawBoxes:
        """The detections in the image that ``camera`` takes of the world ``now``. index: of the frame."""
        found, scores, labels = [], [], []
        rng = np.random.default_rng([self._scenario.seed, 13, index])
        for seen in in_image(now, camera):
            series = self._series(seen.actor.actor.id)[min(index, self._frames - 1)]
            fresh = np.random.default_rng([self._scenario.seed, 14, index, seen.actor.actor.id]).standard_normal(8)
            if _share_below(series[_MISS]) > self._found(seen):
                continue
            box = self._drawn(seen, series, fresh[:4], camera)
            found.append(box)
            scores.append(self._score(seen, series[_SCORE]))
            labels.append(self._label(seen, series[_CALLED]))
            if _share_below(series[_DOUBLED]) < self._noise.doubled:
                width = box[2] - box[0]
                shift = np.array([0.35, 0.1, 0.35, 0.1]) * width * np.sign(fresh[4])
                found.append(box + shift + fresh[4:8] * 0.1 * width)
                scores.append(0.6 * scores[-1])
                labels.append(labels[-1])
        for thing in self._things:
            if thing.first <= index <= thing.last:
                drawn = self._false_box(thing, now, camera, rng)
                if drawn is not None:
                    found.append(drawn)
                    scores.append(thing.score)
                    labels.append(thing.label)
        edges = np.clip(np.array(found).reshape(-1, 4), 0.0, np.tile([camera.width, camera.height], 2))
        whole = (edges[:, 2] > edges[:, 0] + 1.0) & (edges[:, 3] > edges[:, 1] + 1.0)
        return RawBoxes(
            "measured",
            edges[whole].astype(np.float32),
            np.array(scores, dtype=np.float32)[whole],
            tuple(label for label, keep in zip(labels, whole.tolist(), strict=True) if keep),
            LAW,
        )

    def _draw(self, actor: int) -> F64:
        """(frames, ``_COLUMNS``) of one vehicle."""
        slow, edges = (exp(-1.0 / (time_s * self._scenario.rate_hz)) for time_s in (_FORGETS_S, _WANDERS_S))
        step = 10.0 / self._scenario.rate_hz  # correlations were measured at 10 frames a second
        missed = sin(pi / 2 * self._noise.missed_again) ** step
        kept = [missed, missed, slow, missed, *[edges] * 4]
        return lasting([self._scenario.seed, 12, actor], self._frames, np.array(kept))

    def _found(self, seen: VisibleVehicle) -> float:
        """Probability that a frame contains a box of it."""
        away_m = _range_m(seen)
        bin_of = next((n for n, low in enumerate(self._noise.visible[1:]) if seen.visible > low), None)
        if bin_of is None:
            return 0.0
        last_m = self._noise.ranges_m[-1]
        share = float(np.interp(away_m, self._middles_m, self._noise.found[bin_of]))
        return share * 0.5 ** (max(away_m - last_m, 0.0) / _HALVES_M)

    def _drawn(self, seen: VisibleVehicle, series: F64, fresh: F64, camera: CameraCalibration) -> F64:
        noise = self._noise
        whole = np.array(seen.bbox)
        height = whole[3] - whole[1]
        box = whole + noise.hidden_cut * (np.array(seen.shown) - whole)
        scale = float(camera.K[0, 0]) / LAW.focal_px
        new = np.hypot(noise.frame_share * height, noise.frame_px * scale) * fresh
        lasts = np.array([noise.across_share, noise.up_share, noise.across_share, noise.up_share]) * height
        constant = np.random.default_rng([self._scenario.seed, 16, seen.actor.actor.id]).standard_normal(4)
        off = np.sqrt(noise.wanders) * series[_EDGES] + np.sqrt(1.0 - noise.wanders) * constant
        drawn: F64 = box + lasts * off + new
        return drawn

    def _score(self, seen: VisibleVehicle, z: float) -> float:
        bin_of = min(
            int(np.searchsorted(self._noise.ranges_m, _range_m(seen), side="right")) - 1, len(self._middles_m) - 1
        )
        return float(np.interp(_share_below(z), SHARES, self._noise.score[max(bin_of, 0)]))

    def _label(self, seen: VisibleVehicle, z: float) -> str:
        own = LABELS[seen.actor.actor.kind]
        others = self._noise.large_called if own in _LARGE else self._noise.car_called if own == "car" else {}
        share = _share_below(z)
        for name, chance in others.items():
            if share < chance:
                return name
            share -= chance
        return own

    def _false_box(
        self, thing: FalseThing, now: World, camera: CameraCalibration, rng: np.random.Generator
    ) -> F64 | None:
        """The box of a false object at its current position; None outside the image."""
        jitter = rng.standard_normal(4)
        x, y = now.to_ego(np.array([[thing.x, thing.y]]))[0].tolist()
        middle = camera.T_camera_ego @ np.array([x, y, thing.height_m / 2 - LIDAR_HEIGHT_M, 1.0])
        if middle[2] < 2.0:
            return None
        height = camera.K[1, 1] * thing.height_m / middle[2] * exp(self._noise.false_boxes.height_share * jitter[0])
        u = camera.K[0, 0] * middle[0] / middle[2] + camera.K[0, 2] + 0.05 * height * jitter[1]
        v = camera.K[1, 1] * middle[1] / middle[2] + camera.K[1, 2] + 0.05 * height * jitter[2]
        half = thing.width * height / 2
        return np.array([u - half, v - height / 2, u + half, v + height / 2])


def _false_things(scenario: Scenario, noise: MeasuredNoise) -> tuple[FalseThing, ...]:
    """All false objects of the drive: their rate is chosen so that the measured mean number exists at any time."""
    rng = np.random.default_rng([scenario.seed, 15])
    of = noise.false_boxes
    step = 10.0 / scenario.rate_hz
    ends = 1.0 - of.lasts**step
    things: list[FalseThing] = []
    for index in range(scenario.frame_count()):
        births = rng.poisson(of.per_frame * ends)
        if not births:
            continue
        x, y, heading = world_state.ego_pose(scenario, index / scenario.rate_hz)
        for _ in range(births if of.seen else 0):
            height_px, width, bearing, score = of.seen[int(rng.integers(len(of.seen)))]
            height_m = _CAR_HEIGHT_M * exp(0.15 * rng.standard_normal())
            away_m = LAW.focal_px * height_m / height_px
            turned = heading + radians(bearing) * (1.0 if rng.random() < 0.5 else -1.0)
            lives = min(int(rng.geometric(ends)), _LONGEST_FALSE)
            place = (x + away_m * cos(turned), y + away_m * sin(turned))
            label = "car" if rng.random() < 0.9 else "truck"
            things.append(FalseThing(len(things), index, index + lives - 1, *place, height_m, width, score, label))
    return tuple(things)


def _range_m(seen: VisibleVehicle) -> float:
    return float(np.hypot(*seen.actor.cuboid.center[:2])) - seen.actor.cuboid.size[0] / 2


def _share_below(z: float) -> float:
    """Of a standard normal variable, accurate to 2·10⁻³: the logistic curve of Bowling et al. 2009."""
    return 1.0 / (1.0 + exp(-(0.07056 * z**3 + 1.5976 * z)))
