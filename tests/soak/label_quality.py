"""How good proposed labels are on the labelled real drives: `python -m tests.soak.label_quality [DRIVE …]`.

Prints, for vehicles ahead to 50 m: how many of the labelled cuboids are proposed, in all and of those with five or more
points; their overlap seen from above and heading; how many proposed tracks with cuboids are no vehicle; and what Snap
and Extend do to cuboids drawn by hand. Needs the recordings in CIPV_DATA; takes a minute of processor time.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.drive.frame_rows import lead_reach_m
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import Cuboid
from pipeline.detection import Detectors
from pipeline.labels.agreement import bev_iou, pairs
from pipeline.labels.cuboids.aggregate import Sweeps, aggregated
from pipeline.labels.cuboids.points_of import Clustered, clustered, inside
from pipeline.labels.cuboids.propagate import propagated
from pipeline.labels.cuboids.refine import refined
from pipeline.labels.cuboids.snap import TooFewPoints, refit
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.registry import import_labels
from pipeline.labels.headings import Moment, Pose, own_poses
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.labels.propose import Seen, propose
from pipeline.labels.recorded_truth import truth_labels
from pipeline.lanes.open_detector import usual_every
from pipeline.params import Params
from pipeline.path.yaw_rate import usable_rate
from pipeline.run import through
from pipeline.sources import open_source
from pipeline.types import VEHICLES, Frame, Result
from pipeline.types.source import Source
from tests import looking
from tests.pipeline.labels.cuboids.test_refine import hand_drawn

DRIVES = {
    "astyx": "astyx:astyx",
    "0009": "kitti:kitti_0009/2011_09_26/2011_09_26_drive_0009_sync",
    "0052": "kitti:kitti_0052",
    "more": "astyx:astyx_more",
}
ORIGIN = Origin("pipeline", "measured", 0)
FARTHEST_M = 50.0
ENOUGH_POINTS = 5
SAME_PLACE_M = 2.5
"""A track within this distance of a labelled vehicle in most frames is that vehicle."""
SNAP_STEP_M = 10
NOTABLE = 0.02
"""A smaller change of the IoU is not counted."""
START_M = 18.0
"""Extend starts at the frame in which a vehicle is about this far away."""

ByFrame = dict[int, list[tuple[LabelTrack, Cuboid]]]


@dataclass(frozen=True)
class Drive:
    """A labelled recording and what the pipeline saw of it."""

    source: Source
    truth: LabelSet
    sweeps: Sweeps
    poses: Mapping[int, Pose]
    proposed: tuple[LabelTrack, ...]
    """Before they are fitted to the points."""


def opened(name: str) -> Source:
    """One of ``DRIVES``."""
    scheme, path = DRIVES[name].split(":")
    return open_source(f"{scheme}:{data_dir() / path}")


def truth_of(name: str, source: Source) -> LabelSet:
    """The labels that come with it."""
    if name == "0009":
        file = data_dir() / "kitti_0009" / "label_02.txt"
        return import_labels(file, drive_of(source), "kitti-tracking", ORIGIN).labels
    return truth_labels(source, tuple(map(str, range(len(source)))), ORIGIN)[0]


def driven(name: str) -> Drive:
    """The recording, run with default parameters."""
    source = opened(name)
    frames = [source.frame(index) for index in range(len(source))]
    seen: dict[int, list[Seen]] = {}
    leads: dict[int, int | None] = {}
    moments: dict[int, Moment] = {}
    for frame, result in _run(source, frames):
        seen[frame.index] = [
            Seen(each.id, each.label, each.cuboid, each.bbox, each.in_path, each.carried, each.score)
            for each in result.objects
        ]
        leads[frame.index] = result.cipv.id if result.cipv is not None else None
        speed, rate = (ego.speed_mps, usable_rate(ego)) if (ego := result.ego) is not None else (None, None)
        moments[frame.index] = Moment(frame.t_ns, speed, rate, lead_reach_m(frame, result))

    @lru_cache(None)
    def sweeps(index: int) -> Clustered | None:
        sweep = frames[index].sweep
        return clustered(sweep.points) if sweep is not None else None

    found = propose(seen, leads, ORIGIN, moments)
    return Drive(source, truth_of(name, source), sweeps, own_poses(moments), found.tracks)


def _run(source: Source, frames: Sequence[Frame]) -> Iterator[tuple[Frame, Result]]:
    image = frames[0].image
    assert image is not None
    height, width = image.bgr.shape[:2]
    lanes = looking.lanes(source.uri, "twinlitenet")
    every = usual_every(lanes and lanes.detector, source.rate_hz)
    boxes, far = looking.yolox_nano(data_dir(), width, height), looking.far_view(data_dir(), width, height)
    far_lanes = looking.far_lanes(source.uri, "twinlitenet")
    return through(frames, Params(), Detectors(boxes, lanes, every, far, far_lanes=far_lanes), "both")


def by_frame(tracks: Sequence[LabelTrack], holds: Callable[[Cuboid], bool] = lambda _: True) -> ByFrame:
    """The cuboids of each frame, with their tracks."""
    found: ByFrame = {}
    for track in tracks:
        for each in track.sightings:
            if each.cuboid is not None and holds(each.cuboid):
                found.setdefault(each.frame, []).append((track, each.cuboid))
    return found


def is_near(cuboid: Cuboid) -> bool:
    """Ahead, to 50 m."""
    return cuboid.center[0] > 0 and math.hypot(*cuboid.center[:2]) < FARTHEST_M


def vehicles(truth: LabelSet) -> list[LabelTrack]:
    """The labelled vehicles."""
    return [each for each in truth.tracks if each.label in VEHICLES]


def report_proposals(name: str, drive: Drive, tracks: Sequence[LabelTrack]) -> None:
    """Against every labelled vehicle to 50 m."""
    wanted, mine = by_frame(vehicles(drive.truth), is_near), by_frame(tracks)
    overlaps, turns, marked, seen, found_seen = [], [], 0, 0, 0
    for frame, there in wanted.items():
        ours = mine.get(frame, [])
        matched = {a: (b, iou) for a, b, iou in pairs([c for _, c in there], [c for _, c in ours])} if ours else {}
        for place, (_, true) in enumerate(there):
            is_seen = _points_in(drive, frame, true) >= ENOUGH_POINTS
            seen, found_seen = seen + is_seen, found_seen + (is_seen and place in matched)
            if place in matched:
                (track, got), iou = ours[matched[place][0]], matched[place][1]
                overlaps.append(iou)
                turns.append(abs(math.remainder(true.yaw_rad - got.yaw_rad, math.tau)))
                marked += turns[-1] > math.pi / 2 and track.heading == "unknown"
    back = [turn for turn in turns if turn > math.pi / 2]
    yaw_deg = math.degrees(float(np.median([min(turn, math.pi - turn) for turn in turns])))
    all_wanted = sum(map(len, wanted.values()))
    print(
        f"{name}: {len(overlaps)} of {all_wanted} cuboids proposed ({found_seen} of {seen} with points), BEV IoU "
        f"median {np.median(overlaps):.3f}, ≥ 0.7 in {np.mean(np.array(overlaps) >= 0.7):.0%}, yaw {yaw_deg:.1f}°, "
        f"reversed {len(back)} ({marked} marked)"
    )


def report_clutter(name: str, drive: Drive, tracks: Sequence[LabelTrack]) -> None:
    """Tracks with cuboids in labelled frames: vehicles and others, at several thresholds."""
    real = by_frame(drive.truth.tracks)
    at: dict[int, list[bool]] = {}
    for track in tracks:
        for each in track.sightings:
            if each.cuboid is not None and each.frame in real:
                near_m = min(math.dist(each.cuboid.center[:2], c.center[:2]) for _, c in real[each.frame])
                at.setdefault(track.id, []).append(near_m < SAME_PLACE_M)
    for threshold in (0.0, 0.2, 0.4):
        shown = [track for track in tracks if (track.confidence or 0.0) >= threshold]
        votes = [np.mean(at[track.id]) >= 0.5 for track in shown if track.id in at]
        boxes = sum(all(each.cuboid is None for each in track.sightings) for track in shown)
        print(
            f"{name}: at {threshold:.0%} {sum(votes)} tracks on vehicles, {len(votes) - sum(votes)} others with "
            f"cuboids, {boxes} with image boxes only"
        )


def report_snap(name: str, drive: Drive) -> None:
    """Of cuboids drawn by hand on every labelled vehicle."""
    rng, gains, far_m, left = np.random.default_rng(0), [], [], 0
    for track in vehicles(drive.truth):
        hand = hand_drawn(track.sightings, rng)
        for true, drawn in zip(track.sightings, hand, strict=True):
            sweep = drive.sweeps(true.frame)
            assert true.cuboid is not None
            assert drawn.cuboid is not None
            if sweep is None or not is_near(true.cuboid):
                continue
            try:
                found = refit(sweep, drawn.cuboid, aggregated(hand, true.frame, drive.sweeps, drive.poses))
            except TooFewPoints:
                continue
            gains.append(bev_iou(found.cuboid, true.cuboid) - bev_iou(drawn.cuboid, true.cuboid))
            far_m.append(math.hypot(*true.cuboid.center[:2]))
            left += not found.is_better
    gain, far = np.array(gains), np.array(far_m)
    print(f"{name}: Snap: {len(gain)} cuboids, left as they are {left / len(gain):.0%}")
    for first_m in range(0, int(FARTHEST_M), SNAP_STEP_M):
        here = gain[(far >= first_m) & (far < first_m + SNAP_STEP_M)]
        if len(here):
            better, worse = int((here > NOTABLE).sum()), int((here < -NOTABLE).sum())
            print(
                f"{name}: Snap: {first_m}–{first_m + SNAP_STEP_M} m: {len(here)} cuboids, IoU better by {NOTABLE} in "
                f"{better}, worse in {worse}, by {max(0.0, -here.min()):.2f} at most"
            )


def report_extend(name: str, drive: Drive) -> None:
    """Of each labelled vehicle from its one cuboid nearest to 18 m."""
    t_ns = [drive.source.t_ns(index) for index in range(len(drive.source))]
    overlaps, wanted = [], 0
    for track in vehicles(drive.truth):
        near = {each.frame: each.cuboid for each in track.sightings if each.cuboid is not None and is_near(each.cuboid)}
        if len(near) < 4:
            continue
        start = min(near, key=lambda at: abs(math.hypot(*near[at].center[:2]) - START_M))
        wanted += len(near) - 1
        for forward in (True, False):
            one = [Sighting(start, near[start])]
            found = propagated(one, t_ns, drive.sweeps, drive.poses, forward=forward)
            overlaps += [bev_iou(each.cuboid, near[each.frame]) for each in found if each.cuboid and each.frame in near]
    if wanted:
        print(f"{name}: Extend: {len(overlaps)} of {wanted} frames found, IoU median {np.median(overlaps):.3f}")


def _points_in(drive: Drive, frame: int, cuboid: Cuboid) -> int:
    sweep = drive.sweeps(frame)
    return 0 if sweep is None else int((inside(sweep.points, cuboid, 0.0) & ~sweep.ground.mask).sum())


def main() -> None:
    for name in sys.argv[1:] or DRIVES:
        drive = driven(name)
        fitted = refined(drive.proposed, drive.sweeps, drive.poses)
        report_proposals(f"{name}, one sweep", drive, drive.proposed)
        report_proposals(f"{name}, fitted", drive, fitted)
        report_clutter(name, drive, fitted)
        report_snap(name, drive)
        report_extend(name, drive)


if __name__ == "__main__":
    main()
