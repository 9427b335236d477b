"""One drive's results compared with its truth: every count that the scores are computed from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from pipeline.common.clips import first_frames
from pipeline.common.errors import BadInput
from pipeline.evaluation.lead_verdict import Judged, LeadRule, judge_lead, judge_lead_box
from pipeline.evaluation.scores import tracking
from pipeline.evaluation.scores.alarms import Alarm, alarms
from pipeline.evaluation.scores.episodes import (
    Acquisition,
    CutIn,
    LeadFrame,
    acquisitions,
    count_switches,
    cut_ins,
    judged_s,
)
from pipeline.evaluation.scores.matching import Error, errors
from pipeline.evaluation.scores.truth import DriveTruth, FrameTruth
from pipeline.labels.link_identities import MAX_GAP_S
from pipeline.params import AebParams
from pipeline.types import Result


@dataclass(frozen=True)
class Rules:
    """The rules of scoring: which vehicle is the lead, and when the emergency brake is due."""

    lead: LeadRule = field(default_factory=LeadRule)
    """Which labelled vehicle is the lead, and how near to it a CIPV must be."""
    aeb: AebParams = field(default_factory=AebParams)
    """Thresholds of warning and braking."""


@dataclass(frozen=True)
class FrameScore:
    """One labelled frame."""

    index: int
    """Index in the recording."""
    t_ns: int
    """Its tick."""
    name: str
    """The recording's own name of it."""
    judged: Judged | None
    """None where the lead is not known."""
    errors: tuple[Error, ...]
    """Of the matched vehicles."""


@dataclass(frozen=True)
class DriveScore:
    """One recording against its truth."""

    uri: str
    """As it was opened."""
    frames: tuple[FrameScore, ...]
    """The labelled ones."""
    judged_s: float
    """Total time in which the lead was judged."""
    clips: int
    """Number of clips, each judged as a separate drive."""
    guarded_s: float
    """Part of ``judged_s`` with known ego speed, for which warning and braking are judged."""
    switches: int
    """How often the CIPV changed while the lead stayed the same."""
    acquisitions: tuple[Acquisition, ...]
    """Every lead, from the time it becomes the lead."""
    cut_ins: tuple[CutIn, ...]
    """Labelled cut-ins, or those derived from the true leads."""
    alarms: tuple[Alarm, ...]
    """Due, given, or both."""
    tracking: tracking.Counts | None
    """None without trackeval."""
    notes: tuple[str, ...] = ()
    """What a reader of the metrics should know, one sentence each."""

    def index_of(self, t_ns: int) -> int:
        """The judged frame nearest to a tick."""
        return min(self.frames, key=lambda frame: abs(frame.t_ns - t_ns)).index


def score_drive(results: Iterable[Result], truth: DriveTruth, rules: Rules) -> DriveScore:
    """Judge the results of one run. Frames are matched by their ticks; BadInput if no labelled frame has a result."""
    pairs = [(result, truth.frames[result.t_ns]) for result in results if result.t_ns in truth.frames]
    if not pairs:
        raise BadInput(f"{truth.uri}: no labelled frame has a result: these are results of another recording")
    index = {tick: n for n, tick in enumerate(truth.ticks)}
    pairs.sort(key=lambda pair: index[pair[0].t_ns])  # times may go back from one clip to the next
    frames, moments, guarded = [], [], []
    for result, known in pairs:
        verdict = judged(result, known, rules)
        frames.append(FrameScore(index[result.t_ns], result.t_ns, result.frame, verdict, errors(result, known)))
        if verdict is not None:
            moments.append(_moment(result, known, verdict))
            guarded += moments[-1:] if result.acc is not None and known.lead_box is None else []
    notes = truth.notes
    if len(pairs) < len(truth.frames):
        notes = (*notes, f"{len(truth.frames) - len(pairs)} labelled frames have no result and do not count.")
    return DriveScore(
        truth.uri,
        tuple(frames),
        judged_s(moments),
        len(first_frames(truth.ticks, MAX_GAP_S)),
        judged_s(guarded),
        count_switches(moments),
        tuple(acquisitions(moments)),
        tuple(cut_ins(moments, truth.frames, truth.cut_ins)),
        tuple(alarms(pairs, rules.aeb)),
        tracking.of_frames(pairs),
        notes,
    )


def judged(result: Result, known: FrameTruth, rules: Rules) -> Judged | None:
    """One labelled frame's verdict; None where the lead is not known."""
    if known.lead_box is not None:
        return judge_lead_box(result, known.lead_box[1])
    return judge_lead(result, known.lead, rules.lead) if known.lead_known else None


def _moment(result: Result, known: FrameTruth, judged: Judged) -> LeadFrame:
    """A lead beyond the scored range counts as none."""
    lead = known.lead.id if known.lead is not None and judged.truth_m is not None else None
    if known.lead_box is not None:
        lead = known.lead_box[0]
    return LeadFrame(result.t_ns, lead, result.cipv.id if result.cipv is not None else None, judged)
