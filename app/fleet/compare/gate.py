"""Rules that a run must meet, from a file: `cipv compare --gate rules.yaml` exits with 1 if one is broken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from app.drive.events import event_kinds
from app.fleet.compare.changes import EventChange
from app.fleet.compare.paired import PairedScore, known_scores
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import did_you_mean, first_complaint, read_yaml


class Rule(BaseModel):
    """What one score, or one kind of event, may be or become."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    score: str | None = None
    """Name of a score."""
    event: str | None = None
    """Kind of event."""
    at_most: float | None = None
    """The run's value, or number of events."""
    at_least: float | None = None
    """The same from below; None: no such limit."""
    worse_by_at_most: float | None = None
    """How far a score may be worse than the base's, in its unit. More is refused where it is sure: where the 95 %
    interval leaves out no change."""
    more_by_at_most: int | None = None
    """How many more events of a kind there may be than in the base."""

    @model_validator(mode="after")
    def _is_about_one_thing(self) -> Rule:
        if (self.score is None) == (self.event is None):
            raise ValueError("name a score or an event")
        if self.score is not None and self.score not in known_scores():
            raise ValueError(f"no such score: {self.score}{did_you_mean(self.score, known_scores())}")
        if self.event is not None and self.event not in event_kinds():
            raise ValueError(f"no such kind of event: {self.event}{did_you_mean(self.event, event_kinds())}")
        if self.score is not None and self.more_by_at_most is not None:
            raise ValueError("more_by_at_most is for events; a score has worse_by_at_most")
        if self.event is not None and self.worse_by_at_most is not None:
            raise ValueError("worse_by_at_most is for scores; an event has more_by_at_most")
        if all(each is None for each in (self.at_most, self.at_least, self.worse_by_at_most, self.more_by_at_most)):
            raise ValueError("has no limit")
        return self


class GateRules(BaseModel):
    """A file of rules."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rules: tuple[Rule, ...]
    """All must be kept; empty: only the limits below."""
    drives_at_least: int = 1
    """Drives that both runs must have; fewer break the gate."""
    aside_at_most: int = 0
    """Recordings that the run may set aside beyond those that the base did."""


def read_rules(file: Path) -> GateRules:
    """The rules of a YAML file. BadInput says what is wrong with it."""
    loaded = read_yaml(file, str(file))
    if not isinstance(loaded, dict):
        raise BadInput(f"{file}: expected `rules:` and a list of them")
    try:
        return GateRules.model_validate(loaded)
    except ValidationError as error:
        raise BadInput(f"{file}: {first_complaint(error, GateRules)}") from None


def broken(
    rules: GateRules, scores: Sequence[PairedScore], events: Sequence[EventChange], drives: int, aside: int
) -> list[str]:
    """The broken rules, as sentences. drives: how many both runs have. aside: recordings that only the run set
    aside."""
    said = []
    if drives < rules.drives_at_least:
        said.append(f"{drives} drives are in both runs; at least {rules.drives_at_least} are required")
    if aside > rules.aside_at_most:
        said.append(f"{aside} more recordings were set aside; at most {rules.aside_at_most} may be")
    by_score, by_kind = {each.info.name: each for each in scores}, {each.kind: each for each in events}
    for rule in rules.rules:
        if rule.score is not None:
            said += _of_score(rule, by_score.get(rule.score))
        elif rule.event is not None:
            said += _of_event(rule, by_kind.get(rule.event) or EventChange(rule.event, 0, 0, 0, 0))
    return said


def _of_score(rule: Rule, score: PairedScore | None) -> Iterator[str]:
    if score is None or score.run is None:
        yield f"{rule.score}: no drive has this score in both runs"
        return
    yield from _limits(rule, f"{rule.score}", score.run, f" {score.info.unit}".rstrip())
    if rule.worse_by_at_most is not None and score.worse_by is not None:
        is_sure = score.is_sure or score.interval is None
        if score.worse_by > rule.worse_by_at_most and is_sure:
            yield (
                f"{rule.score}: {score.base:.4g} became {score.run:.4g}, worse by {score.worse_by:.4g}; "
                f"at most {rule.worse_by_at_most:g} is allowed"
            )


def _of_event(rule: Rule, event: EventChange) -> Iterator[str]:
    yield from _limits(rule, event.kind, event.run, " events")
    if rule.more_by_at_most is not None and event.run - event.base > rule.more_by_at_most:
        yield (f"{event.kind}: {event.base} events became {event.run}; at most {rule.more_by_at_most} more are allowed")


def _limits(rule: Rule, name: str, value: float, unit: str) -> Iterator[str]:
    if rule.at_most is not None and value > rule.at_most:
        yield f"{name}: {value:.4g}{unit}; at most {rule.at_most:g} is allowed"
    if rule.at_least is not None and value < rule.at_least:
        yield f"{name}: {value:.4g}{unit}; at least {rule.at_least:g} is required"
