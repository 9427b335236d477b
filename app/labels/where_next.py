"""Where there is something to do: the next frame without a lead, with a proposal, sent back, or judged otherwise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, cast

from app.drive.run import DriveRun
from app.labels.drive import DriveLabels
from app.labels.scoring import LabelScores, disagreements
from pipeline.evaluation.lead import Judged
from pipeline.labels.model import LabelTrack, LeadRange

What = Literal["unlabelled", "disagreement", "proposed", "sent_back"]
_NOTHING: dict[What, str] = {
    "unlabelled": "who leads is said in every frame there",
    "disagreement": "the pipeline and the accepted labels agree there",
    "proposed": "no proposal is waiting there",
    "sent_back": "nothing was sent back there",
}


def where_next(
    labels: DriveLabels, scores: LabelScores, run: DriveRun | None, what: What, frame: int, direction: int
) -> tuple[int | None, str]:
    """(the nearest such frame after ``frame``, or before it; why it is one). Null with why there is none."""
    places = _places(labels, scores, run, what)
    ahead = [each for each in places if (each[0] > frame if direction > 0 else each[0] < frame)]
    if not ahead:
        return None, _NOTHING[what]
    return min(ahead, key=lambda each: abs(each[0] - frame))


def _places(labels: DriveLabels, scores: LabelScores, run: DriveRun | None, what: What) -> Sequence[tuple[int, str]]:
    if what == "unlabelled":
        return _unlabelled(labels)
    if what == "disagreement":
        return _disagreements(labels, scores, run)
    return _waiting(labels, sent_back=what == "sent_back")


def _unlabelled(labels: DriveLabels) -> list[tuple[int, str]]:
    said: set[int] = set()
    for lead in _leads(labels):
        if lead.state != "rejected":
            said.update(range(lead.first, lead.last + 1))
    return [(index, "nobody has said who leads") for index in range(len(labels.info.t_ns)) if index not in said]


def _waiting(labels: DriveLabels, *, sent_back: bool) -> list[tuple[int, str]]:
    """Where a proposed track or range begins."""
    found = labels.changes()
    places = []
    for item in found.items:
        if item.kind == "track":
            track = cast("LabelTrack", item.value)
            if track.state == "proposed" and item.id in found.extents and (bool(track.comment) or not sent_back):
                why = f"#{item.id}: {track.comment}" if track.comment else f"#{item.id} is proposed"
                places.append((found.extents[item.id][0], why))
    if not sent_back:
        places += [(lead.first, "the lead is proposed") for lead in _leads(labels) if lead.state == "proposed"]
    return places


def _disagreements(labels: DriveLabels, scores: LabelScores, run: DriveRun | None) -> list[tuple[int, str]]:
    score = scores.score(labels, run) if run is not None else None
    if run is None or score is None:
        return []
    rows, leads = run.rows(), list(_leads(labels))
    return [(index, _otherwise(each, rows[index].cipv_id, leads, index)) for index, each in disagreements(score)]


def _otherwise(judged: Judged, cipv: int | None, leads: Iterable[LeadRange], index: int) -> str:
    lead = next((each.lead for each in leads if each.first <= index <= each.last and each.state != "rejected"), None)
    says = f"#{lead}" if isinstance(lead, int) else "none" if judged.verdict == "false" else "another"
    ours = f"#{cipv}" if cipv is not None else "none"
    beside = f", {judged.error_m:+.1f} m off" if judged.error_m is not None else ""
    return f"the pipeline says {ours}{beside}, the labels say {says}"


def _leads(labels: DriveLabels) -> Iterable[LeadRange]:
    return (cast("LeadRange", item.value) for item in labels.items("lead").values())
