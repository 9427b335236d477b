"""What counts as true: a recording's own labels, and what people accepted."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import pytest

from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.evaluation.scores.drive import Rules, score_drive
from pipeline.evaluation.scores.figures import FIGURES
from pipeline.evaluation.scores.truth import (
    DriveTruth,
    FrameTruth,
    NoTruth,
    of_labels,
    of_source,
    with_velocities,
)
from pipeline.labels.link_identities import linked
from pipeline.labels.model import (
    WHOLE_TAG,
    EventLabel,
    FrameTag,
    LabelSet,
    LabelTrack,
    Lead,
    LeadRange,
    Origin,
    Sighting,
    State,
)
from pipeline.sources import open_source
from pipeline.sources.driven_way import DrivenWay
from pipeline.types import EgoState, FusedObject
from pipeline.types.source import TruthObject
from tests.pipeline.build import cuboid, fused
from tests.pipeline.evaluation.scores.drives import TICK_NS, believed, labelled

PERSON = Origin("person", "someone", 0)
IMPORT = Origin("import", "a file", 0)
PIPELINE = Origin("pipeline", "run 1", 0)
RULE = LeadRule()


def track(
    key: int, x: float, y: float = 0.0, state: State = "accepted", by: Origin = IMPORT, label: str = "car"
) -> LabelTrack:
    return LabelTrack(key, label, tuple(Sighting(n, cuboid(x - n, y)) for n in range(3)), state, by)


def labels(
    *tracks: LabelTrack,
    leads: tuple[LeadRange, ...] = (),
    events: tuple[EventLabel, ...] = (),
    tags: tuple[FrameTag, ...] = (),
) -> LabelSet:
    return LabelSet("made:1", ("a", "b", "c"), (0, TICK_NS, 2 * TICK_NS), tracks, leads, events=events, tags=tags)


def led(first: int, last: int, lead: Lead, state: State = "accepted", by: Origin = PERSON) -> LeadRange:
    return LeadRange(first, last, lead, state, by)


def leads(known: DriveTruth) -> list[int | str | None]:
    """The lead's id in each labelled frame; None without a lead, a question mark if it is unclear."""
    return [
        (frame.lead.id if frame.lead is not None else None) if frame.lead_known else "?"
        for frame in known.frames.values()
    ]


def test_without_labelled_leads_the_nearest_in_the_lane_leads() -> None:
    assert leads(of_labels(labels(track(4, 30.0), track(5, 20.0, 3.5)), RULE)) == [4, 4, 4]


def test_in_a_bend_the_nearest_on_the_way_leads() -> None:
    """The car turns left on a circle of 50 m radius: where the vehicles are, its way is 4 to 5 m to the left."""
    made, ticks = labels(track(4, 20.0), track(5, 20.0, 4.3)), [n * TICK_NS for n in range(60)]
    turning = DrivenWay(ticks, [EgoState(tick, 10.0, 0.2, source="can") for tick in ticks])
    assert leads(of_labels(made, RULE)) == [4, 4, 4]
    assert leads(of_labels(made, RULE, lambda: turning)) == [5, 5, 5]
    said = replace(made, leads=(led(0, 2, 4),))
    assert leads(of_labels(said, RULE, lambda: turning)) == [4, 4, 4], "a person has decided"


@pytest.mark.parametrize(
    ("ranges", "expected"),
    [
        pytest.param((led(0, 2, 5),), [5, 5, 5], id="the one that people say, though it is beside the lane"),
        pytest.param((led(0, 0, 5), led(1, 2, "none")), [5, None, None], id="none is an answer"),
        pytest.param((led(0, 1, "unknown"), led(2, 2, 4)), ["?", "?", 4], id="can't tell is not judged"),
        pytest.param((led(1, 1, 4),), ["?", 4, "?"], id="frames that nobody spoke about are not judged"),
        pytest.param((led(0, 1, 4), led(2, 2, 5, "proposed")), [4, 4, "?"], id="a proposal is no truth"),
        pytest.param((led(0, 2, 9),), ["?", "?", "?"], id="a lead whose place is not labelled"),
    ],
)
def test_labelled_leads(ranges: tuple[LeadRange, ...], expected: list[int | str | None]) -> None:
    assert leads(of_labels(labels(track(4, 30.0), track(5, 20.0, 3.5), leads=ranges), RULE)) == expected


@pytest.mark.parametrize(
    ("objects", "verdict"),
    [
        pytest.param([], "missed", id="nothing chosen"),
        pytest.param([fused(7, 20.0)], "correct", id="its box"),
        pytest.param([replace(fused(7, 20.0), bbox=(6.0, 0.0, 16.0, 10.0))], "wrong", id="a box beside it"),
        pytest.param([replace(fused(7, 20.0), bbox=None)], "wrong", id="seen by the LiDAR alone"),
    ],
)
def test_a_lead_that_only_the_image_shows(objects: list[FusedObject], verdict: str) -> None:
    only_box = LabelTrack(4, "car", (Sighting(0, None, (0.0, 0.0, 10.0, 9.0)),), "accepted", PERSON)
    known = of_labels(labels(only_box, leads=(led(0, 0, 4),)), RULE)
    result = believed(0, objects, 7 if objects else None, "warn")
    score = score_drive([result], known, Rules())
    (frame,) = score.frames
    assert frame.judged is not None
    assert frame.judged.verdict == verdict
    assert frame.judged.error_m is None
    assert [each.lead for each in score.acquisitions] == [4]
    assert score.alarms == (), "nobody knows how far off it is"


@pytest.mark.parametrize("state", get_args(State))
def test_only_what_somebody_stands_behind_counts(state: State) -> None:
    known = of_labels(labels(track(4, 30.0), track(5, 20.0, state=state)), RULE)
    counts = state in ("accepted", "corrected")
    assert {item.id for item in known.frames[0].objects} == ({4, 5} if counts else {4})
    assert any("only proposed" in note for note in known.notes) == (state == "proposed")


AWAY = ((0, 30.0), (1, 39.0), (2, 29.0))
TAGGED = tuple(FrameTag(n, n, WHOLE_TAG, PERSON) for n in (0, 2))
LED = (led(0, 2, 4, by=PIPELINE),)


@pytest.mark.parametrize(
    ("known", "whole"),
    [
        pytest.param(labels(track(4, 30.0), track(5, 20.0)), 3, id="imported"),
        pytest.param(labels(track(4, 30.0), track(5, 20.0, state="proposed")), 0, id="a vehicle is left proposed"),
        pytest.param(
            labels(track(4, 30.0), track(5, 20.0, state="proposed", label="person")), 3, id="a person is left"
        ),
        pytest.param(labels(track(4, 30.0), track(5, 20.0, state="rejected", by=PIPELINE)), 3, id="the other is none"),
        pytest.param(labels(track(4, 30.0, by=PERSON)), 0, id="drawn by hand: nobody knows what else is there"),
        pytest.param(labels(track(4, 30.0, by=PERSON), tags=TAGGED), 2, id="drawn by hand, and said to be all"),
        pytest.param(
            labels(track(4, 30.0, by=PERSON), tags=(FrameTag(0, 2, WHOLE_TAG, PERSON),)), 3, id="all, in one range"
        ),
        pytest.param(labels(track(4, 30.0, by=PERSON), leads=LED), 3, id="a proposal that was put right"),
        pytest.param(labels(track(4, 30.0, state="proposed"), leads=LED, tags=TAGGED), 0, id="tagged too early"),
    ],
)
def test_frames_in_which_every_vehicle_is_labelled(known: LabelSet, whole: int) -> None:
    found = of_labels(known, RULE)
    assert sum(frame.whole for frame in found.frames.values()) == whole
    assert any(f"in {whole} of 3 labelled frames" in note for note in found.notes) == (whole < 3)


def test_a_vehicle_that_nobody_looked_at_is_not_claimed_falsely() -> None:
    """The pipeline sees both cars. One is first unlabelled, then labelled as no vehicle, then as a vehicle."""
    pytest.importorskip("trackeval", reason="the extra `scores` is not installed")
    results = [believed(n, [fused(7, 30.0 - n), fused(8, 20.0 - n, 3.5)], 7) for n in range(3)]

    def precision(state: State) -> float | None:
        other = track(5, 20.0, 3.5, state=state, by=PIPELINE)
        score = score_drive(results, of_labels(labels(track(4, 30.0, by=PIPELINE), other, leads=LED), RULE), Rules())
        assert all(frame.judged is not None and frame.judged.verdict == "correct" for frame in score.frames)
        return next(figure for figure in FIGURES if figure.name == "precision").of([score])

    assert (precision("proposed"), precision("rejected"), precision("accepted")) == (None, 50.0, 100.0)


def test_no_lead_is_derived_where_a_nearer_vehicle_may_not_be_labelled() -> None:
    known = of_labels(labels(track(4, 30.0), track(5, 20.0, state="proposed")), RULE)
    assert leads(known) == ["?", "?", "?"]
    assert any("No lead is labelled" in note for note in known.notes)


def test_a_lead_that_is_only_proposed_is_said() -> None:
    known = of_labels(labels(track(4, 30.0, state="proposed"), leads=LED), RULE)
    assert leads(known) == ["?", "?", "?"]
    assert "#4 leads in 3 frames but is only proposed: not scored until accepted." in known.notes


def test_labels_that_nobody_accepted_are_no_truth() -> None:
    with pytest.raises(NoTruth, match="accepted"):
        of_labels(labels(track(4, 30.0, state="proposed")), RULE)


def test_labelled_cut_ins() -> None:
    event = EventLabel(1, "cut_in", (4,), "accepted", PERSON)
    refused = replace(event, frame=2, state="rejected")
    assert of_labels(labels(track(4, 30.0), events=(event, refused)), RULE).cut_ins == ((TICK_NS, 4),)
    assert of_labels(labels(track(4, 30.0)), RULE).cut_ins is None


def test_velocity_comes_from_the_frames_around() -> None:
    known = of_labels(labels(track(4, 30.0)), RULE)
    for frame in known.frames.values():
        assert frame.velocity_mps is not None
        assert frame.velocity_mps[4] == pytest.approx((-10.0, 0.0))


def test_no_velocity_across_a_gap() -> None:
    frames = {tick: FrameTruth(tick, (labelled(1, 20.0),), None) for tick in (0, 10_000_000_000)}
    assert all(frame.velocity_mps == {} for frame in with_velocities(frames)[0].values())


def nameless(x: float, y: float = 0.0, label: str = "car") -> TruthObject:
    return TruthObject(label, cuboid(x, y))


def test_labels_without_identity_are_linked_to_the_nearest_of_their_class() -> None:
    ids = {
        tick: [item.id for item in items]
        for tick, items in linked(
            {
                0: (nameless(20.0), nameless(40.0)),
                TICK_NS: (nameless(39.5), nameless(19.5)),
                2 * TICK_NS: (nameless(19.2, label="truck"), nameless(39.0), nameless(60.0)),
                9_000_000_000: (nameless(39.0),),
            }
        ).items()
    }
    assert ids == {0: [1, 2], TICK_NS: [2, 1], 2 * TICK_NS: [3, 2, 4], 9_000_000_000: [5]}


def test_tracks_of_one_frame_each_are_linked_too() -> None:
    """As in a file of KITTI's object labels."""
    alone = [LabelTrack(n + 1, "car", (Sighting(n, cuboid(30.0 - n, 0.0)),), "accepted", IMPORT) for n in range(3)]
    known = of_labels(labels(*alone), RULE)
    assert leads(known) == [1, 1, 1]
    assert any("linked" in note for note in known.notes)
    assert known.frames[0].velocity_mps == {1: pytest.approx((-10.0, 0.0))}


def test_a_recording_that_nobody_labelled() -> None:
    class Unlabelled:
        uri, title, rate_hz, notes = "made:1", "made", 10.0, ()

        def __len__(self) -> int:
            return 2

        def t_ns(self, index: int) -> int:
            return index * TICK_NS

        def truth(self, index: int) -> None:
            return None

    with pytest.raises(NoTruth, match="made:1: no frame"):
        of_source(Unlabelled(), RULE)  # type: ignore[arg-type]


def test_the_simulators_own_truth() -> None:
    source = open_source("sim:cut_in")
    known = of_source(source, RULE)
    assert len(known.frames) == len(known.ticks) == len(source)
    assert known.notes == (), "the simulator knows who is who"
    assert any(frame.lead is not None for frame in known.frames.values())


def test_what_a_person_should_know_is_said() -> None:
    """A position that no vehicle can have reached, positions taken from the pipeline, and unfinished work."""
    jumping = replace(track(4, 30.0, by=PIPELINE), sightings=tuple(Sighting(n, cuboid(x, 0.0)) for n, x in AWAY))
    known = of_labels(labels(jumping, track(5, 20.0, state="proposed")), RULE)
    assert [frame.velocity_mps for frame in known.frames.values()] == [{}, {}, {}]
    notes = " ".join(known.notes)
    assert "1 track jumps in 3 places" in notes
    assert "3 of 3 labelled positions are unchanged proposals" in notes
    assert "In 3 a vehicle is only proposed" in notes
    assert "Not confirmed as fully labelled" not in notes
    by_hand = " ".join(of_labels(labels(track(4, 30.0, by=PERSON), tags=TAGGED), RULE).notes)
    assert "Not confirmed as fully labelled: 1. Tag them “all labelled”" in by_hand
    assert not any(words in by_hand for words in ("jump", "unchanged proposals", "only proposed"))
