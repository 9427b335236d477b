"""Finds implausible labels to check before export. Changes nothing.

The limits were checked on KITTI drive 0009, whose 411 cuboids were labelled as tracks: none reaches half of a limit. In
Astyx, labelled frame by frame, 136 steps have 23 jumps in size, 18 in position, and 6 in heading (four half turns).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import cv2
import numpy as np

from pipeline.common.geometry import Cuboid, iou_matrix
from pipeline.labels.boxes import boxes_of
from pipeline.labels.formats.base import LabeledDrive
from pipeline.labels.model import COUNTED_STATES, LabelSet, LabelTrack, Sighting

LONGEST_STEP_S = 0.5
"""Jumps are not checked between frames farther apart in time."""
_MOST_TURN_DEG_S = 60.0
"""A car in its tightest turn rotates by about 45°/s."""
_LEAST_TURN_DEG = 10.0
"""Accuracy of manual labels."""
_MOST_ACCELERATION_MPS2 = 15.0
"""Maximum relative acceleration, with two vehicles braking or accelerating at their limits."""
_LEAST_STEP_M = 0.5
"""Tolerance for a centre's deviation from a smooth path: two cuboids drawn a quarter of a metre off in opposite
directions. KITTI: at most 0.13 m. Proposals that exceed it are 1.1 m off (median), the others 0.25 m."""
_MOST_GROWTH_M = 0.3
"""Bodies are rigid; a person's size differs by this between two frames."""
_MOST_OVERLAP = 0.1
"""Share of the smaller footprint."""
_LEAST_BOX_IOU = 0.5
"""KITTI's own boxes have at least 0.79 with the projected cuboids."""


@dataclass(frozen=True)
class Problem:
    """Something implausible in labels."""

    frame: int
    """The frame to show."""
    track: int | None
    """The track to select; None if only the lead is concerned."""
    words: str
    """One sentence for the person who labels."""


def problems(labels: LabelSet, drive: LabeledDrive) -> list[Problem]:
    """Problems by frame. Proposals and rejected labels are not checked; nor are frames more than ``LONGEST_STEP_S``
    apart."""
    tracks = [track for track in labels.tracks if track.state in COUNTED_STATES]
    found = [
        *(each for track in tracks for each in _of_track(track, drive.t_ns)),
        *_overlaps(tracks),
        *_boxes_apart(tracks, drive),
        *_leads(labels),
    ]
    return sorted(found, key=lambda each: (each.frame, each.track or 0, each.words))


def _of_track(track: LabelTrack, t_ns: Sequence[int]) -> Iterator[Problem]:
    seen = [(each, each.cuboid) for each in track.sightings if each.cuboid is not None]
    for (before, a), (after, b) in pairwise(seen):
        step_s = (t_ns[after.frame] - t_ns[before.frame]) / 1e9
        if not 0.0 < step_s <= LONGEST_STEP_S:
            continue
        name = f"#{track.id} {track.label}"
        growth_m = max(abs(one - other) for one, other in zip(a.size, b.size, strict=True))
        if growth_m > _MOST_GROWTH_M:
            yield Problem(after.frame, track.id, f"{name}: its size jumps by {growth_m:.1f} m")
        turn_deg = abs(math.degrees(math.remainder(b.yaw_rad - a.yaw_rad, math.tau)))
        if turn_deg > max(_LEAST_TURN_DEG, _MOST_TURN_DEG_S * step_s):
            yield Problem(after.frame, track.id, f"{name}: it turns by {turn_deg:.0f}° in {step_s:.1f} s")
    yield from _jumps(track, [(each.frame, cuboid) for each, cuboid in seen], t_ns)


def _jumps(track: LabelTrack, seen: list[tuple[int, Cuboid]], t_ns: Sequence[int]) -> Iterator[Problem]:
    """Positions in three consecutive frames that do not form a smooth path."""
    for (f0, a), (f1, b), (f2, c) in zip(seen, seen[1:], seen[2:], strict=False):
        first_s, second_s = (t_ns[f1] - t_ns[f0]) / 1e9, (t_ns[f2] - t_ns[f1]) / 1e9
        if not (0.0 < first_s <= LONGEST_STEP_S and 0.0 < second_s <= LONGEST_STEP_S):
            continue
        places = np.array([a.center[:2], b.center[:2], c.center[:2]])
        share = first_s / (first_s + second_s)
        off_m = float(np.hypot(*(places[1] - (1.0 - share) * places[0] - share * places[2])))
        allowed_m = max(_LEAST_STEP_M, 0.5 * _MOST_ACCELERATION_MPS2 * first_s * second_s)
        if off_m > allowed_m:
            yield Problem(f1, track.id, f"#{track.id} {track.label}: it jumps by {off_m:.1f} m")


def _overlaps(tracks: Sequence[LabelTrack]) -> Iterator[Problem]:
    by_frame: dict[int, list[tuple[LabelTrack, Cuboid]]] = {}
    for track in tracks:
        for each in track.sightings:
            if each.cuboid is not None:
                by_frame.setdefault(each.frame, []).append((track, each.cuboid))
    for frame, found in by_frame.items():
        for (one, a), (other, b) in combinations(found, 2):
            reach = (math.hypot(*a.size[:2]) + math.hypot(*b.size[:2])) / 2
            if math.dist(a.center[:2], b.center[:2]) < reach and _overlap(a, b) > _MOST_OVERLAP:
                yield Problem(frame, one.id, f"#{one.id} {one.label} and #{other.id} {other.label} overlap")


def _overlap(a: Cuboid, b: Cuboid) -> float:
    """The common area of two footprints as a share of the smaller one."""
    one, other = (np.asarray(each.footprint(), dtype=np.float32) for each in (a, b))
    common, _ = cv2.intersectConvexConvex(one, other)
    return float(common) / min(each.size[0] * each.size[1] for each in (a, b))


def _boxes_apart(tracks: Sequence[LabelTrack], drive: LabeledDrive) -> Iterator[Problem]:
    """Manually set boxes that differ from the projected cuboid."""
    for track in tracks:
        for each in track.sightings:
            if each.box_set and each.cuboid is not None and each.bbox is not None and _is_apart(each, drive):
                yield Problem(each.frame, track.id, f"#{track.id} {track.label}: its box does not match its cuboid")


def _is_apart(sighting: Sighting, drive: LabeledDrive) -> bool:
    camera = drive.shots[sighting.frame].camera
    if camera is None or sighting.cuboid is None:
        return False
    ((box, _),) = boxes_of([sighting.cuboid], camera)
    return box is None or float(iou_matrix(np.array([box]), np.array([sighting.bbox]))[0, 0]) < _LEAST_BOX_IOU


def _leads(labels: LabelSet) -> Iterator[Problem]:
    tracks = {track.id: track for track in labels.tracks}
    for lead in labels.leads:
        if lead.state in ("proposed", "rejected") or not isinstance(lead.lead, int):
            continue
        track = tracks.get(lead.lead)
        if track is None or track.state == "rejected":
            yield Problem(lead.first, None, f"the lead is #{lead.lead}, which is not labelled")
            continue
        there = {each.frame: each for each in track.sightings}
        gone = next((frame for frame in range(lead.first, lead.last + 1) if frame not in there), None)
        if gone is not None:
            yield Problem(gone, track.id, f"the lead is #{track.id}, which is not in this frame")
        cuboids = [(frame, there[frame].cuboid) for frame in range(lead.first, lead.last + 1) if frame in there]
        behind = next((frame for frame, cuboid in cuboids if cuboid is not None and cuboid.center[0] < 0.0), None)
        if behind is not None:
            yield Problem(behind, track.id, f"the lead is #{track.id}, which is behind the ego vehicle")
