"""Detection and tracking of vehicles: precision, recall, MOTA, IDF1 and HOTA, as trackeval counts them.

Positions are compared, not image boxes: the similarity of two is 1 − d/4 m, d between the middles of their nearest
faces, so the usual threshold of 0.5 is the 2 m of nuScenes. HOTA averages over d = 3.8 … 0.2 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from pipeline.common.near_face import near_face_middle
from pipeline.evaluation.scores.matching import claims, face_of, vehicles
from pipeline.evaluation.scores.truth import FrameTruth
from pipeline.types import I64, Point2, Result

ZERO_M = 4.0
"""Distance from which the similarity is 0."""
MATCH_M = 0.5 * ZERO_M
MISSING = "Detection and tracking scores need trackeval, which `make install` installs."
NamedPositions = list[tuple[int, Point2]]
"""Ids and positions of one frame's vehicles."""


@dataclass(frozen=True)
class Counts:
    """One drive's counts in trackeval's form, to be summed over drives."""

    clear: dict[str, Any]
    """For MOTA, precision and recall."""
    identity: dict[str, Any]
    """For IDF1."""
    hota: dict[str, Any]
    """For HOTA, by localisation threshold."""


def is_available() -> bool:
    """Whether trackeval is installed."""
    return _metrics() is not None


def of_frames(frames: Sequence[tuple[Result, FrameTruth]]) -> Counts | None:
    """Counts of a drive's labelled frames, in order. Frames that are not completely labelled are left out, because an
    object without a label may be correct there. None if the other frames contain no vehicle with a labelled position,
    and without trackeval."""
    truths, believed = [], []
    for result, truth in frames:
        if not truth.whole:
            continue
        wanted = vehicles(truth.objects)
        truths.append([(item.id or 0, face_of(item)) for item in wanted])
        found = claims(result, wanted, MATCH_M, truth.unplaced)
        believed.append([(item.id, near_face_middle(item.bev)) for item in found if item.bev is not None])
    return count(truths, believed) if any(truths) else None


def count(truths: Sequence[NamedPositions], believed: Sequence[NamedPositions]) -> Counts | None:
    """Counts from the true vehicles and the reported ones, frame by frame."""
    metrics = _metrics()
    if metrics is None:
        return None
    data = _sequence(truths, believed)
    return Counts(*(metric.eval_sequence(data) for metric in metrics))


def precision_sums(counts: Counts) -> tuple[int, int]:
    """Precision: correctly reported vehicles over all reported ones."""
    clear = counts.clear
    return clear["CLR_TP"], clear["CLR_TP"] + clear["CLR_FP"]


def recall_sums(counts: Counts) -> tuple[int, int]:
    """Recall: found vehicles over all true ones."""
    clear = counts.clear
    return clear["CLR_TP"], clear["CLR_TP"] + clear["CLR_FN"]


def mota_sums(counts: Counts) -> tuple[int, int]:
    """(Found − falsely reported − switched) over all true ones (CLEAR MOT)."""
    clear = counts.clear
    return clear["CLR_TP"] - clear["CLR_FP"] - clear["IDSW"], clear["CLR_TP"] + clear["CLR_FN"]


def idf1_sums(counts: Counts) -> tuple[int, int]:
    """Twice the correctly identified over the sum of true and reported ones."""
    named = counts.identity
    return 2 * named["IDTP"], 2 * named["IDTP"] + named["IDFN"] + named["IDFP"]


def hota_of(drives: Sequence[Counts]) -> float | None:
    """HOTA over several drives together, 0–1; None without vehicles."""
    metrics = _metrics()
    if metrics is None or not any(recall_sums(drive)[1] for drive in drives):
        return None
    whole = metrics[2].combine_sequences({str(n): drive.hota for n, drive in enumerate(drives)})
    return float(np.mean(whole["HOTA"]))


@cache
def _metrics() -> tuple[Any, Any, Any] | None:
    """CLEAR, Identity and HOTA; imported on first use, which takes a second."""
    try:
        from trackeval.metrics import CLEAR, HOTA, Identity
    except ImportError:
        return None
    config = {"THRESHOLD": 0.5, "PRINT_CONFIG": False}
    return CLEAR(config), Identity(config), HOTA()


def _sequence(truths: Sequence[NamedPositions], believed: Sequence[NamedPositions]) -> dict[str, Any]:
    """The input of trackeval for a sequence: ids counted from 0, and similarities (truth, reported) of each frame."""
    gt_ids, gt_count = _from_zero(truths)
    tracker_ids, tracker_count = _from_zero(believed)
    return {
        "num_timesteps": len(truths),
        "num_gt_ids": gt_count,
        "num_tracker_ids": tracker_count,
        "num_gt_dets": sum(map(len, truths)),
        "num_tracker_dets": sum(map(len, believed)),
        "gt_ids": gt_ids,
        "tracker_ids": tracker_ids,
        "similarity_scores": [_similarity(a, b) for a, b in zip(truths, believed, strict=True)],
    }


def _from_zero(frames: Sequence[NamedPositions]) -> tuple[list[I64], int]:
    known = {key: n for n, key in enumerate(sorted({key for frame in frames for key, _ in frame}))}
    return [np.array([known[key] for key, _ in frame], dtype=np.int64) for frame in frames], len(known)


def _similarity(truths: NamedPositions, believed: NamedPositions) -> np.ndarray:
    a = np.array([place for _, place in truths]).reshape(-1, 1, 2)
    b = np.array([place for _, place in believed]).reshape(1, -1, 2)
    return np.clip(1.0 - np.hypot(*np.moveaxis(a - b, 2, 0)) / ZERO_M, 0.0, None)
