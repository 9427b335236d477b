"""Whether the CIPV is the right vehicle, and the error of its distance, judged frame by frame against labelled
cuboids."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from pipeline.common.geometry import closest_on_polygon, iou_matrix
from pipeline.common.near_face import near_face_middle
from pipeline.labels.model import FARTHEST_LEAD_M
from pipeline.types import VEHICLES, Box, Point2, Result
from pipeline.types.source import TruthObject

Verdict = Literal["correct", "none", "missed", "false", "wrong"]
"""correct: the right vehicle · none: correctly no CIPV · missed: there is a lead, but no CIPV · false: a CIPV without a
lead · wrong: a CIPV that is not where the lead is: another vehicle, or the lead with too large a distance error
(`LeadRule`)."""

LABELLED_VEHICLES = VEHICLES | {"van", "tram", "trailer", "other vehicle", "motorcyclist"}
"""Label names of the recordings that may be a lead, in lower case."""

SAME_BOX_IOU = 0.5


@dataclass(frozen=True)
class LeadRule:
    """Defines which labelled vehicle is the lead, and when a CIPV matches it."""

    half_lane_m: float = 1.5
    """A vehicle whose centre is closer than this to the way that the car takes is in the lane; where the recording does
    not tell that way, to the car's axis."""
    max_range_m: float = FARTHEST_LEAD_M
    """Leads beyond this are ignored."""
    lateral_slack_m: float = 0.3
    """Permitted lateral distance of a CIPV from the label."""
    range_slack: float = 0.15
    """Permitted longitudinal distance from the label, as a share of its range."""
    range_slack_m: float = 2.0
    """Minimum of ``range_slack`` in metres."""


@dataclass(frozen=True)
class Judged:
    """One frame's verdict. Distances are horizontal ranges to the nearest face."""

    frame: str
    """The recording's own name of it."""
    verdict: Verdict
    """Of the CIPV against the labelled lead."""
    truth_m: float | None
    """Range of the labelled lead; None without a lead."""
    distance_m: float | None
    """Range of the CIPV; None without one."""
    lateral_error_m: float | None
    """Lateral distance of the CIPV from the lead, 0 if it overlaps; None if one of them is missing."""

    @property
    def error_m(self) -> float | None:
        """Estimated minus true distance of every CIPV that matches the lead laterally, including those whose distance
        error is too large to count as correct. None otherwise."""
        beside = self.lateral_error_m is None or self.lateral_error_m > 0.0
        if beside or self.truth_m is None or self.distance_m is None:
            return None
        return self.distance_m - self.truth_m


def true_lead(truth: Iterable[TruthObject], rule: LeadRule) -> TruthObject | None:
    """The nearest labelled vehicle in the lane."""
    ahead = [
        item
        for item in truth
        if item.label.lower() in LABELLED_VEHICLES
        and item.cuboid.center[0] > 0.0
        and abs(_beside_m(item)) < rule.half_lane_m
        and nearest_face_m(item) <= rule.max_range_m
    ]
    return min(ahead, key=nearest_face_m, default=None)


def _beside_m(item: TruthObject) -> float:
    return item.cuboid.center[1] if item.path_offset_m is None else item.path_offset_m


def nearest_face_m(item: TruthObject) -> float:
    """Horizontal range from the ego origin to the nearest point of the labelled cuboid."""
    return float(np.hypot(*closest_on_polygon(item.cuboid.footprint())))


def judge(result: Result, truth: Iterable[TruthObject], rule: LeadRule) -> Judged:
    """One frame's CIPV against its labels, where the lead is the nearest vehicle in the lane."""
    return judge_lead(result, true_lead(truth, rule), rule)


def judge_lead(result: Result, lead: TruthObject | None, rule: LeadRule) -> Judged:
    """One frame's CIPV compared with the known lead; None: there is none. A lead beyond the scored range counts as
    none."""
    if lead is not None and nearest_face_m(lead) > rule.max_range_m:
        lead = None
    chosen = result.chosen()
    in_reach = chosen is not None and chosen.distance_m is not None and chosen.distance_m <= rule.max_range_m
    if lead is None:
        distance = chosen.distance_m if chosen is not None and in_reach else None
        return Judged(result.frame, "false" if in_reach else "none", None, distance, None)
    truth_m = nearest_face_m(lead)
    if chosen is None or chosen.distance_m is None or chosen.bev is None:
        return Judged(result.frame, "missed", truth_m, None, None)
    lateral = max(_lateral_error(chosen.bev, lead) - rule.lateral_slack_m, 0.0)
    lengthwise = abs(chosen.distance_m - truth_m) <= max(rule.range_slack_m, rule.range_slack * truth_m)
    on_it = lateral == 0.0 and lengthwise
    return Judged(result.frame, "correct" if on_it else "wrong", truth_m, chosen.distance_m, lateral)


def judge_lead_box(result: Result, bbox: Box) -> Judged:
    """One frame's CIPV against a lead that is labelled in the image only: correct when the IoU of their boxes is at
    least one half. Its distance is unknown."""
    chosen = result.chosen()
    if chosen is None:
        return Judged(result.frame, "missed", None, None, None)
    on_it = chosen.bbox is not None and iou_matrix(np.array([chosen.bbox]), np.array([bbox]))[0, 0] >= SAME_BOX_IOU
    return Judged(result.frame, "correct" if on_it else "wrong", None, chosen.distance_m, None)


def _lateral_error(bev: tuple[Point2, Point2, Point2, Point2], lead: TruthObject) -> float:
    """Lateral distance of the middle of the object's nearest face from the label's lateral extent; 0 inside it."""
    y = near_face_middle(bev)[1]
    sides = lead.cuboid.footprint()[:, 1]
    return float(max(sides.min() - y, y - sides.max(), 0.0))


def switches(pairs: Iterable[tuple[int | None, int | None]]) -> int:
    """How often the id of the chosen object changed while the true lead stayed the same. pairs: for each frame the true
    lead and the chosen object; frames that lack one of them are skipped."""
    both = [(lead, chosen) for lead, chosen in pairs if lead is not None and chosen is not None]
    return sum(before[0] == after[0] and before[1] != after[1] for before, after in pairwise(both))


@dataclass(frozen=True)
class LeadScore:
    """Metrics of a drive. Errors are over the frames that have one."""

    frames: int
    """Number of judged frames."""
    correct: int
    """The CIPV is the lead, or there is neither."""
    missed: int
    """There is a lead and no CIPV."""
    false: int
    """There is a CIPV and no lead."""
    wrong: int
    """The CIPV is another vehicle than the lead."""
    mean_error_m: float | None
    """Of the CIPV's distance; None if no frame has both distances."""
    max_error_m: float | None
    """Maximum of the same."""
    mean_relative_error: float | None
    """Mean of the errors as shares of the true distance."""


def score(judged: Iterable[Judged]) -> LeadScore:
    """Sum up the frames."""
    rows = list(judged)
    pairs = [(abs(row.error_m), row.truth_m) for row in rows if row.error_m is not None and row.truth_m]
    errors = [error for error, _ in pairs]
    count = {verdict: sum(row.verdict == verdict for row in rows) for verdict in ("missed", "false", "wrong")}
    return LeadScore(
        frames=len(rows),
        correct=sum(row.verdict in ("correct", "none") for row in rows),
        **count,
        mean_error_m=float(np.mean(errors)) if errors else None,
        max_error_m=max(errors) if errors else None,
        mean_relative_error=float(np.mean([error / true for error, true in pairs])) if pairs else None,
    )
