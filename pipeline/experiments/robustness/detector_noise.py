"""Computes a detector's errors, as ``MeasuredNoise``, from labelled vehicles and their detections."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from math import log

import numpy as np

from pipeline.common.geometry import iou_matrix
from pipeline.simulation.sensors.measured_noise import SHARES, FalseBoxes, MeasuredNoise
from pipeline.types import F64, Box, Detection

DOUBLE = 0.25
"""Overlap above which a second box belongs to the same vehicle."""
RANGES_M = (0.0, 15.0, 25.0, 35.0, 45.0, 60.0, 80.0)
VISIBLE = (1.0, 0.8, 0.4, 0.1)
_LARGE = ("truck", "bus")
_WIDE_STRIP = 0.1
"""Narrower hidden strips, as a share of the height, disappear in the errors of single edges."""
_BOXED_WELL_M = 12.0
"""Nearer, boxes end at shadows and show more of a flank as one passes."""
_LATER_S = 1.0, 3.0
"""After this time, errors that change slowly are new; vehicles are rarely seen for longer."""
_STEP_S = 0.15
"""Only frames at most this far apart show which errors persist from frame to frame."""


@dataclass
class JudgedVehicle:
    """One labelled vehicle in one frame."""

    recording: int
    """Number of the recording."""
    frame: int
    """Index in the recording."""
    t_s: float
    """Time of the frame."""
    track: int | None
    """Id of the track; None if the labels have no ids."""
    label: str
    """True class."""
    range_m: float
    """Distance of its nearest face."""
    visible: float
    """Visible share, 0–1."""
    hidden: F64
    """(4,) by how much of the height each edge of the visible part lies inside its true box, signed as ``offs``."""
    found: Detection | None
    """The box that was found for it; None if it was missed."""
    offs: F64 | None
    """(4,) error of each edge as a share of the height; None if it was missed."""
    height_px: float
    """Height of its true box."""
    doubled: bool
    """Whether a second box was found for it."""


@dataclass
class Counted:
    """All labelled vehicles and false boxes: (recording, t_s, box at 907 px, bearing, score)."""

    seen: list[JudgedVehicle] = field(default_factory=list)
    """Every labelled vehicle in every frame."""
    false: list[tuple[int, float, Box, float, float]] = field(default_factory=list)
    """(recording, t_s, box at 907 px, bearing, score) of each false box."""
    frames: int = 0
    """Number of labelled frames."""


def summed_up(counted: Counted, measured_on: Sequence[str]) -> MeasuredNoise:
    """The numbers of the noise model. The mean error of each edge is subtracted first: it only says that a cuboid's
    projection is larger than the vehicle's image."""
    bins = [_between(counted.seen, low, high) for low, high in pairwise(RANGES_M)]
    found = tuple(
        tuple(_share_found([s for s in each if low < s.visible <= high]) for each in bins)
        for high, low in pairwise(VISIBLE)
    )
    clear = [seen for seen in counted.seen if seen.visible > VISIBLE[1] and seen.offs is not None]
    offs = np.array([seen.offs for seen in clear])
    white = _white(clear)
    lasting = np.sqrt(np.maximum(_spread(offs) ** 2 - white**2, 0.0))
    return MeasuredNoise(
        measured_on=tuple(measured_on),
        ranges_m=RANGES_M,
        vehicles=tuple(sum(seen.visible > VISIBLE[1] for seen in each) for each in bins),
        visible=VISIBLE,
        found=found,
        missed_again=_missed_again(counted.seen),
        across_share=round(float(lasting[[0, 2]].mean()), 4),
        up_share=round(float(lasting[[1, 3]].mean()), 4),
        wanders=_wanders([seen for seen in clear if seen.range_m > _BOXED_WELL_M]),
        frame_share=round(float(white.mean()), 4),
        frame_px=round(_white_px(clear), 2),
        hidden_cut=_hidden_cut(counted.seen, np.median(offs, axis=0)),
        score=tuple(_quantiles([s.found.score for s in each if s.found is not None]) for each in bins),
        car_called=_called([seen for seen in clear if seen.label not in (*_LARGE, "motorcycle")], "car"),
        large_called=_called([seen for seen in clear if seen.label in _LARGE], "truck"),
        doubled=round(float(np.mean([seen.doubled for seen in clear])), 4),
        false_boxes=_false(counted),
    )


def _between(seen: Sequence[JudgedVehicle], low: float, high: float) -> list[JudgedVehicle]:
    return [each for each in seen if low <= each.range_m < high]


def _share_found(seen: Sequence[JudgedVehicle]) -> float:
    """Share of vehicles found, with half a vehicle added to those found and to those missed, so that it is not 0 or 1
    by chance (Jeffreys)."""
    return round((sum(each.found is not None for each in seen) + 0.5) / (len(seen) + 1.0), 3)


def _spread(values: F64) -> F64:
    """Standard deviation of each column, estimated from the quartiles, so that a few boxes around two vehicles have no
    effect."""
    low, high = np.percentile(values, [25, 75], axis=0)
    spread: F64 = (high - low) / 1.349
    return spread


def _followed(seen: Sequence[JudgedVehicle]) -> Iterator[tuple[JudgedVehicle, JudgedVehicle]]:
    """Yield the same vehicle in two consecutive frames."""
    by_key = {(each.recording, each.track, each.frame): each for each in seen if each.track is not None}
    for (recording, track, frame), now in by_key.items():
        after = by_key.get((recording, track, frame + 1))
        if after is not None and 0.0 < after.t_s - now.t_s < _STEP_S:
            yield now, after


def _white(seen: Sequence[JudgedVehicle]) -> F64:
    steps = [b.offs - a.offs for a, b in _followed(seen) if a.offs is not None and b.offs is not None]
    return _spread(np.array(steps)) / np.sqrt(2.0) if len(steps) > 20 else np.full(4, 0.03)


def _wanders(seen: Sequence[JudgedVehicle]) -> float:
    """Share of the lasting variance of edges by which the errors of one vehicle differ after seconds."""
    steps = [
        (b.offs - a.offs) / np.sqrt(2.0)
        for track in _tracks(seen)
        for a, b in combinations(track, 2)
        if a.offs is not None and b.offs is not None and _LATER_S[0] < b.t_s - a.t_s < _LATER_S[1]
    ]
    if len(steps) <= 20:
        return 1.0
    white = _white(seen) ** 2
    lasting = _spread(np.array([each.offs for each in seen])) ** 2 - white
    changed = np.maximum(_spread(np.array(steps)) ** 2 - white, 0.0)
    return round(float(np.clip(np.mean(changed / lasting), 0.0, 1.0)), 3)


def _tracks(seen: Sequence[JudgedVehicle]) -> list[list[JudgedVehicle]]:
    """The sightings of each vehicle that has a track, in order of time."""
    tracks: dict[tuple[int, int], list[JudgedVehicle]] = {}
    for each in sorted(seen, key=lambda each: each.t_s):
        if each.track is not None:
            tracks.setdefault((each.recording, each.track), []).append(each)
    return list(tracks.values())


def _white_px(seen: Sequence[JudgedVehicle]) -> float:
    """White noise in pixels, of the vehicles with the smallest boxes, for which pixels matter instead of shares."""
    low = sorted(_followed(seen), key=lambda pair: pair[0].height_px)
    low = low[: max(len(low) // 3, 1)]
    steps = [(b.offs - a.offs) * a.height_px for a, b in low if a.offs is not None and b.offs is not None]
    return float(_spread(np.array(steps)).mean() / np.sqrt(2.0)) if len(steps) > 20 else 0.7


def _hidden_cut(seen: Sequence[JudgedVehicle], usual: F64) -> float:
    """By which share of a hidden strip boxes are smaller, the median over edges. usual: error of each edge of a vehicle
    that is not hidden."""
    cuts = [
        (each.offs - usual)[edge] / each.hidden[edge]
        for each in seen
        if each.offs is not None and each.visible > VISIBLE[2]
        for edge in range(4)
        if abs(each.hidden[edge]) > _WIDE_STRIP
    ]
    return round(float(np.clip(np.median(cuts), 0.0, 1.0)), 3) if cuts else 0.0


def _missed_again(seen: Sequence[JudgedVehicle]) -> float:
    """Correlation of being missed in two consecutive frames, over all vehicles that are partly visible."""
    pairs = [(a.found is None, b.found is None) for a, b in _followed(seen) if a.visible > VISIBLE[2]]
    return round(float(np.clip(np.corrcoef(np.array(pairs, dtype=float).T)[0, 1], 0.0, 0.98)), 3)


def _quantiles(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(float(value), 3) for value in np.quantile(values or [0.5], SHARES))


def _called(seen: Sequence[JudgedVehicle], own: str) -> dict[str, float]:
    names = Counter(each.found.label for each in seen if each.found is not None)
    total = max(sum(names.values()), 1)
    return {name: round(n / total, 4) for name, n in sorted(names.items()) if name not in (own, "motorcycle")}


def _false(counted: Counted) -> FalseBoxes:
    false = counted.false
    again, grown, could = 0, [], 0
    times: dict[int, set[float]] = {}
    for seen in counted.seen:
        times.setdefault(seen.recording, set()).add(seen.t_s)
    for recording, t_s, box, _, _ in false:
        later = [t for t in sorted(times[recording]) if 0.0 < t - t_s < _STEP_S]
        if not later:
            continue
        could += 1
        next_boxes = [other for r, t, other, _, _ in false if r == recording and t == later[0]]
        overlap = iou_matrix(np.array([box]), np.array(next_boxes).reshape(-1, 4))[0]
        if len(overlap) and overlap.max() > DOUBLE:
            again += 1
            best = next_boxes[int(overlap.argmax())]
            grown.append(log((best[3] - best[1]) / (box[3] - box[1])))
    return FalseBoxes(
        per_frame=round(len(false) / counted.frames, 3),
        lasts=round(again / max(could, 1), 3),
        seen=tuple(
            (
                round(box[3] - box[1], 1),
                round((box[2] - box[0]) / (box[3] - box[1]), 2),
                round(bearing, 1),
                round(score, 2),
            )
            for _, _, box, bearing, score in sorted(false, key=lambda each: each[2][3] - each[2][1])
        ),
        height_share=round(float(_spread(np.array(grown))), 3) if len(grown) > 5 else 0.1,
    )
