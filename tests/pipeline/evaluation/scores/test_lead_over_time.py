"""Switches, drop-outs, acquisition and cut-ins of drives whose figures can be counted by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.truth import DriveTruth, FrameTruth, with_velocities
from pipeline.types import Result
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import TICK_NS, believed, labelled, truth


def judged(chosen: list[int | None], known: DriveTruth) -> DriveScore:
    """The CIPV matches the true lead whenever one is chosen. Numbers are object ids."""
    results: list[Result] = []
    for n, number in enumerate(chosen):
        lead = known.frames[n * TICK_NS].lead
        x = lead.cuboid.center[0] - 2.0 if lead is not None else 30.0
        results.append(believed(n, [fused(number, x)] if number is not None else [], number))
    return score_drive(results, known, Rules())


STEADY = truth(*({1: (40.0 - n, 0.0)} for n in range(8)))


@pytest.mark.parametrize(
    ("chosen", "switches", "drop_outs", "acquired_m", "after_s"),
    [
        pytest.param([7] * 8, 0, 0, 40.0, 0.0, id="one number from the start"),
        pytest.param([7, 7, 8, 8, 7, 7, 7, 7], 2, 0, 40.0, 0.0, id="there and back are two switches"),
        pytest.param([None, None, 7, 7, 7, 7, 7, 7], 0, 0, 38.0, 0.2, id="found later is no drop-out"),
        pytest.param([7, None, None, 7, 7, None, 7, 7], 0, 2, 40.0, 0.0, id="lost twice"),
        pytest.param([7, None, 8, 8, 8, 8, 8, 8], 1, 1, 40.0, 0.0, id="lost and found under another number"),
        pytest.param([None] * 8, 0, 0, None, None, id="never found"),
    ],
)
def test_one_lead(
    chosen: list[int | None], switches: int, drop_outs: int, acquired_m: float | None, after_s: float | None
) -> None:
    score = judged(chosen, STEADY)
    (lead,) = score.acquisitions
    assert score.switches == switches
    assert lead.drop_outs == drop_outs
    assert lead.range_m == (pytest.approx(acquired_m) if acquired_m is not None else None)
    assert lead.after_s == (pytest.approx(after_s) if after_s is not None else None)
    assert lead.from_start
    assert score.judged_s == pytest.approx(0.7)


def test_a_new_lead_is_no_switch_and_one_that_was_beside_the_lane_cuts_in() -> None:
    places = [{1: (40.0, 0.0), 2: (20.0, max(3.5 - n, 0.0))} for n in range(8)]  # 2 is in the lane from frame 3 on
    score = judged([7, 7, 7, None, None, 9, 9, 9], truth(*places))
    assert score.switches == 0
    assert [lead.lead for lead in score.acquisitions] == [1, 2]
    assert [lead.from_start for lead in score.acquisitions] == [True, False]
    (cut_in,) = score.cut_ins
    assert (cut_in.lead, cut_in.t_ns) == (2, 3 * TICK_NS)
    assert cut_in.latency_s == pytest.approx(0.2)


def test_a_lead_that_takes_over_because_the_first_one_leaves_cuts_nothing() -> None:
    places = [{1: (20.0, n * 0.6), 2: (40.0, 0.0)} for n in range(6)]
    score = judged([7] * 3 + [8] * 3, truth(*places))
    assert [lead.lead for lead in score.acquisitions] == [1, 2]
    assert score.cut_ins == ()


def test_a_labelled_cut_in_counts_from_when_people_saw_it() -> None:
    places = [{1: (40.0, 0.0), 2: (20.0, max(3.5 - n, 0.0))} for n in range(8)]
    known = truth(*places)
    said = DriveTruth(known.uri, known.ticks, known.frames, ((4 * TICK_NS, 2),))
    (cut_in,) = judged([7, 7, 7, None, None, 9, 9, 9], said).cut_ins
    assert (cut_in.t_ns, cut_in.latency_s) == (4 * TICK_NS, pytest.approx(0.1))


def test_a_moment_between_judged_frames_leads_to_the_nearest_one() -> None:
    score = judged([7, 7], truth({1: (40.0, 0.0)}, {1: (39.0, 0.0)}))
    assert [score.index_of(t_ns) for t_ns in (0, TICK_NS, 5 * TICK_NS)] == [0, 1, 1]


def test_nothing_is_compared_across_a_gap() -> None:
    frames = [{1: (40.0, 0.0)}, {1: (39.0, 0.0)}, *[None] * 20, {1: (18.0, 0.0)}, {1: (17.0, 0.0)}]
    known = truth(*frames)
    results = [
        believed(n, [fused(number, x)], number) for n, x, number in ((0, 40, 7), (1, 39, 7), (22, 18, 8), (23, 17, 8))
    ]
    score = score_drive(results, known, Rules())
    assert score.switches == 0
    assert score.judged_s == pytest.approx(0.2)
    assert [lead.from_start for lead in score.acquisitions] == [True, True]


def test_frames_in_which_nobody_knows_who_leads_do_not_count() -> None:
    known = truth({1: (40.0, 0.0)}, {1: (39.0, 0.0)})
    unknown = replace(known.frames[TICK_NS], lead=None, lead_known=False)
    score = judged([7, 7], replace(known, frames={**known.frames, TICK_NS: unknown}))
    assert [frame.judged is None for frame in score.frames] == [False, True]


def test_clips_that_overlap_in_time_are_drives_of_their_own() -> None:
    """The second clip's times run back into the first's; its lead and its speeds are its own."""
    first = {n * TICK_NS: 30.0 + n for n in range(4)}
    second = {n * TICK_NS + TICK_NS // 2: 60.0 - n for n in range(4)}
    ticks = (*first, *second)
    alone = truth({1: (30.0, 0.0)})
    frames = {}
    for tick, x in {**first, **second}.items():
        objects = (labelled(1, x),)
        frames[tick] = FrameTruth(tick, objects, objects[0])
    known = DriveTruth(alone.uri, ticks, with_velocities(frames)[0])
    results = []
    for tick, x in sorted({**first, **second}.items()):  # as a results file has them
        number = 7 if tick in first else 8
        results.append(replace(believed(0, [fused(number, x - 2.0)], number), t_ns=tick, frame=str(tick)))
    score = score_drive(results, known, Rules())
    assert score.clips == 2
    assert score.judged_s == pytest.approx(0.6)
    assert score.switches == 0
    assert len(score.acquisitions) == 2
    speeds = [known.frames[tick].velocity_mps[1][0] for tick in (*first, *second)]  # type: ignore[index]
    assert speeds == pytest.approx([10.0] * 4 + [-10.0] * 4)
