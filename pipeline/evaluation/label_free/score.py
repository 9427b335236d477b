"""The scores of a drive that need no labels. Each is a sum divided by a count, so scores of drives can be combined.

docs/reference/fleet-scores.md shows how well each of them agrees with labels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from pipeline.common.clips import begins_clip
from pipeline.evaluation.label_free.backward import look_back
from pipeline.evaluation.label_free.history import NONE, SIGHTING, History, SightingRecords
from pipeline.evaluation.scores.figures import Sums
from pipeline.evaluation.scores.matching import MAX_RANGE_M, UNRANGED_SHARE
from pipeline.types import F64, I64

DriveScores = dict[str, Sums]
"""By name of the score: the drive's contribution to its numerator and its denominator."""

SURE_SHARE, SURE_M = 0.1, 0.5
"""An earlier distance is judged if later measurements determine it to this share of it, or to this value."""
PROOFS = 3
"""Sightings by both sensors that must measure an object before the camera's earlier distances are judged."""
FARTHEST_M, LARGEST_SHARE = MAX_RANGE_M, UNRANGED_SHARE
"""As in scoring with labels: vehicles are judged up to this distance, and the camera's error is capped at this share of
it, which is the maximum distance of an object from its matching label."""
SURE_MPS, FASTEST_MPS = 2.0, 70.0
"""An earlier closing speed is judged if later measurements determine it to the first, and if it is below the second:
250 km/h, which nothing on a road exceeds."""
PROOF_S, LEAST_PROOF_S = 2.0, 1.0
"""Time after its selection in which a lead must be confirmed. If the clip ends before the second, it is not judged."""
PHANTOM_SHARE = 0.5
"""A lead is a phantom if it was seen in the path for less than this share of that time."""
LATE_S, LASTING_S, NEARER_M = 3.0, 0.5, 0.5
"""How far before its selection a lead is searched, if it led for longer than the second, and how much nearer than the
object chosen there it must be."""


class ScoredClip(NamedTuple):
    """A part of a drive without gaps."""

    t_s: F64
    """(N,) time of each frame."""
    lead: I64
    """(N,) id of the CIPV, ``NONE`` without one."""
    objects: dict[int, SightingRecords]
    """Sightings by id; ``frame`` is counted from the clip's start."""


@dataclass(frozen=True)
class LabelFreeScore:
    """One score without labels."""

    name: str
    """Name in tables and rules."""
    title: str
    """Display name."""
    unit: str
    """Unit of the ratio, e.g. ``%`` or ``m/s``."""
    better: Literal["higher", "lower"]
    """Which direction is an improvement."""
    of: Callable[[ScoredClip], Sums]
    """Contribution of a clip to numerator and denominator."""
    counterpart: str
    """The corresponding metric that uses labels."""


def label_free_scores(history: History, gap_s: float) -> DriveScores:
    """All scores of a drive. gap_s: longest time between two frames of one clip."""
    clips = list(clips_of(history, gap_s))
    return {score.name: _sum(score.of(clip) for clip in clips) for score in SCORES}


def _sum(parts: Iterator[Sums]) -> Sums:
    over = under = 0.0
    for part in parts:
        over, under = over + part[0], under + part[1]
    return float(over), float(under)


def clips_of(history: History, gap_s: float) -> Iterator[ScoredClip]:
    """The drive's parts without gaps."""
    t_ns, t_s, lead, sightings = history.t_ns, history.t_s, history.lead, history.sightings()
    begins = [n for n in range(len(t_ns)) if n == 0 or begins_clip(int(t_ns[n - 1]), int(t_ns[n]), gap_s)]
    for first, end in pairwise([*begins, len(t_ns)]):
        inside = sightings[(sightings["frame"] >= first) & (sightings["frame"] < end)].copy()
        inside["frame"] -= first
        ids, starts = np.unique(inside["id"], return_index=True)
        objects = dict(zip(ids.tolist(), np.split(inside, starts[1:]), strict=True)) if len(ids) else {}
        yield ScoredClip(t_s[first:end], lead[first:end], objects)


# ---------------------------------------------------------------- camera distances, judged by later LiDAR measurements


def _hindsight(clip: ScoredClip) -> Iterator[tuple[SightingRecords, F64, F64, F64]]:
    """For each object: camera-only sightings, and distance, closing speed and the latter's standard deviation from
    later measurements."""
    for seen in clip.objects.values():
        proved = seen["ranged"] & seen["two_sensors"]
        if not seen["by_camera"].any() or proved.sum() < PROOFS:
            continue
        looked = look_back(clip.t_s[seen["frame"]], np.where(proved, seen["distance_m"], np.nan).astype(np.float64))
        with np.errstate(invalid="ignore"):
            sure = looked.sigma_m <= np.maximum(SURE_M, SURE_SHARE * looked.distance_m)
            inside = (looked.distance_m > 1.0) & (looked.distance_m <= FARTHEST_M)
        judged = seen["by_camera"] & sure & inside
        yield seen[judged], looked.distance_m[judged], looked.closing_mps[judged], looked.closing_sigma_mps[judged]


def camera_distance(clip: ScoredClip) -> Sums:
    """Mean absolute error of the camera, relative to the distance from later LiDAR measurements."""
    over = under = 0.0
    for seen, distance_m, *_ in _hindsight(clip):
        over += float(np.minimum(np.abs(seen["distance_m"] - distance_m) / distance_m, LARGEST_SHARE).sum())
        under += len(seen)
    return 100.0 * over, under


def camera_speed(clip: ScoredClip) -> Sums:
    """Mean absolute error of the camera's closing speed."""
    over = under = 0.0
    for seen, _, closing, sigma in _hindsight(clip):
        known = np.isfinite(seen["closing_mps"]) & (sigma <= SURE_MPS) & (np.abs(closing) < FASTEST_MPS)
        over += float(np.abs(seen["closing_mps"] - closing)[known].sum())
        under += int(known.sum())
    return over, under


# ---------------------------------------------------------------- the choice of the lead


class Episode(NamedTuple):
    """Consecutive frames with the same lead."""

    lead: int
    """Id of the object that is the CIPV; never ``NONE``."""
    first: int
    """Index of the first frame, counted from the clip's first."""
    last: int
    """Index of the last frame, inclusive."""


def episodes(lead: I64) -> list[Episode]:
    """All episodes of a clip, in order."""
    changes = np.flatnonzero(np.diff(lead)) + 1
    bounds = [0, *changes.tolist(), len(lead)] if len(lead) else [0]
    return [Episode(int(lead[first]), first, end - 1) for first, end in pairwise(bounds) if lead[first] != NONE]


def _there(clip: ScoredClip, number: int) -> np.ndarray:
    """(N,) frames in which an object was in the path and seen by any sensor."""
    found = np.zeros(len(clip.t_s), bool)
    seen = clip.objects.get(number, np.zeros(0, SIGHTING))
    found[seen["frame"]] = seen["in_path"] & ~seen["carried"]
    return found


def phantom_frames(clip: ScoredClip) -> np.ndarray:
    """(N,) frames whose lead later turned out not to exist, or to be beside the path."""
    phantom = np.zeros(len(clip.t_s), bool)
    for episode in episodes(clip.lead):
        there = _there(clip, episode.lead)
        until = int(np.searchsorted(clip.t_s, clip.t_s[episode.first] + PROOF_S, side="right"))
        if clip.t_s[-1] - clip.t_s[episode.first] < LEAST_PROOF_S:
            continue  # unknown what it would have turned out to be
        after = there[episode.first : until]
        if after.mean() < PHANTOM_SHARE:
            phantom[episode.first : episode.last + 1] = True
    return phantom


def phantom_leads(clip: ScoredClip) -> Sums:
    """Share of the frames with a lead that later turned out not to exist, or to be beside the path."""
    return 100.0 * float(phantom_frames(clip).sum()), float(len(clip.t_s))


def late_frames(clip: ScoredClip) -> np.ndarray:
    """(N,) frames in which a lead was not chosen yet, or no longer, although it was in the path and nearer than any
    other."""
    late = np.zeros(len(clip.t_s), bool)
    for episode in episodes(clip.lead):
        if clip.t_s[episode.last] - clip.t_s[episode.first] < LASTING_S:
            continue
        seen = clip.objects.get(episode.lead, np.zeros(0, SIGHTING))
        there = _there(clip, episode.lead)
        distance = np.full(len(clip.t_s), np.nan)
        distance[seen["frame"]] = seen["distance_m"]
        at = episode.first - 1
        while at >= 0 and clip.t_s[episode.first] - clip.t_s[at] <= LATE_S and there[at]:
            chosen = clip.objects.get(int(clip.lead[at]), np.zeros(0, SIGHTING))
            other = chosen["distance_m"][chosen["frame"] == at]
            if not len(other) or distance[at] < other[0] - NEARER_M:
                late[at] = True
            at -= 1
    return late


def late_leads(clip: ScoredClip) -> Sums:
    """Share of the frames in which the lead existed but was not chosen."""
    return 100.0 * float(late_frames(clip).sum()), float(len(clip.t_s))


def lead_doubted(clip: ScoredClip) -> Sums:
    """Share of the frames whose choice is contradicted by the following seconds."""
    return 100.0 * float((phantom_frames(clip) | late_frames(clip)).sum()), float(len(clip.t_s))


def switches(clip: ScoredClip) -> Sums:
    """Changes of the lead per minute, except to or from none."""
    both = (clip.lead[1:] != NONE) & (clip.lead[:-1] != NONE)
    return float((both & (clip.lead[1:] != clip.lead[:-1])).sum()), _minutes(clip)


def _minutes(clip: ScoredClip) -> float:
    return float(clip.t_s[-1] - clip.t_s[0]) / 60.0 if len(clip.t_s) else 0.0


# ---------------------------------------------------------------- consistency of distances


def jitter(clip: ScoredClip) -> Sums:
    """Deviation of the lead's distance from the median of its neighbours, in metres."""
    over = under = 0.0
    for episode in episodes(clip.lead):
        seen = clip.objects.get(episode.lead, np.zeros(0, SIGHTING))
        seen = seen[(seen["frame"] >= episode.first) & (seen["frame"] <= episode.last) & ~seen["carried"]]
        distance, frame = seen["distance_m"].astype(np.float64), seen["frame"]
        if len(seen) < 3:
            continue
        together = (frame[2:] - frame[:-2] == 2) & np.isfinite(distance[2:] + distance[1:-1] + distance[:-2])
        off = np.abs(distance[1:-1] - (distance[2:] + distance[:-2]) / 2.0)
        over, under = over + float(off[together].sum()), under + int(together.sum())
    return over, under


SCORES: tuple[LabelFreeScore, ...] = (
    LabelFreeScore(
        "camera_distance", "camera's distance in hindsight", "%", "lower", camera_distance, "camera_distance"
    ),
    LabelFreeScore("camera_speed", "camera's closing speed in hindsight", "m/s", "lower", camera_speed, "camera_speed"),
    LabelFreeScore("lead_doubted", "lead contradicted later", "%", "lower", lead_doubted, "lead_not_correct"),
    LabelFreeScore("phantom_leads", "phantom leads", "%", "lower", phantom_leads, "cipv_false"),
    LabelFreeScore("late_leads", "leads found late", "%", "lower", late_leads, "lead_missed"),
    LabelFreeScore("switches", "switches of the lead", "per minute", "lower", switches, "switches"),
    LabelFreeScore("jitter", "jitter of the lead's distance", "m", "lower", jitter, "lead_distance"),
)
"""In the order of reports."""
