"""Which labels are exported."""

from __future__ import annotations

import pytest

from pipeline.labels.model import EventLabel, LabelSet, LabelTrack, LeadRange, Origin, State
from pipeline.labels.selection import Selection, selected

BY = Origin("person", "Ada", 1)


def track(number: int, state: State, reviewer: str = "", comment: str = "") -> LabelTrack:
    return LabelTrack(number, "car", (), state, BY, comment, reviewer)


LABELS = LabelSet(
    "test",
    ("0", "1", "2", "3"),
    (0, 1, 2, 3),
    (track(1, "proposed"), track(2, "accepted"), track(3, "corrected", "Bob"), track(4, "rejected")),
    (
        LeadRange(0, 0, 1, "accepted", BY, "", "Bob"),
        LeadRange(1, 1, 2, "accepted", BY),
        LeadRange(2, 2, "none", "accepted", BY, "", "Bob"),
        LeadRange(3, 3, 3, "proposed", BY),
    ),
    events=(EventLabel(1, "cut_in", (2, 1), "accepted", BY, "", "Bob"), EventLabel(2, "cut_out", (3,), "accepted", BY)),
)


@pytest.mark.parametrize(
    ("what", "tracks", "leads", "events", "name"),
    [
        ("all", [1, 2, 3, 4], [0, 1, 2, 3], ["cut_in", "cut_out"], "working"),
        ("accepted", [2, 3], [1, 2], ["cut_out"], "working, accepted only"),
        ("reviewed", [3], [2], [], "working, reviewed only"),
    ],
)
def test_only_what_somebody_stands_behind_is_taken_and_the_set_says_so(
    what: Selection, tracks: list[int], leads: list[int], events: list[str], name: str
) -> None:
    found = selected(LABELS, what)
    assert [each.id for each in found.tracks] == tracks
    assert [each.first for each in found.leads] == leads
    assert [each.kind for each in found.events] == events
    assert found.name == name
