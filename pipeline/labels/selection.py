"""Selects the accepted or reviewed labels of a set, for training or scoring elsewhere."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from pipeline.labels.model import COUNTED_STATES, EventLabel, LabelSet, LabelTrack, LeadRange, PathLabel

Selection = Literal["all", "accepted", "reviewed"]
"""accepted: accepted or corrected by a person or a file. reviewed: also approved by a second person."""


def selected(labels: LabelSet, what: Selection) -> LabelSet:
    """The set without the others; its name includes the selection. Leads and events of removed tracks are removed as
    well."""
    if what == "all":
        return labels

    def stands(label: LabelTrack | LeadRange | PathLabel | EventLabel) -> bool:
        is_accepted = label.state in COUNTED_STATES and not label.comment
        return is_accepted and (what == "accepted" or bool(label.reviewer))

    tracks = tuple(filter(stands, labels.tracks))
    kept = {track.id for track in tracks}
    return replace(
        labels,
        tracks=tracks,
        leads=tuple(
            each for each in labels.leads if stands(each) and (isinstance(each.lead, str) or each.lead in kept)
        ),
        paths=tuple(filter(stands, labels.paths)),
        events=tuple(each for each in labels.events if stands(each) and kept.issuperset(each.tracks)),
        name=f"{labels.name}, {what} only",
    )
