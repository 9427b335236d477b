"""The queue of recordings: whose each is, how far it is, and what is worth most."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from app.commands.labels.people import State as Offered
from app.labels.errors import ActRefused, NoSuchLabel
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.work import put, queue
from app.labels.work_states import State
from pipeline.common.geometry import Cuboid
from pipeline.labels.model import LabelTrack, LeadRange, Origin, Sighting
from tests.app.labels.acts.doing import act
from tests.app.labels.conftest import info

AHEAD = Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0)
PIPELINE = Origin("pipeline", "run 1", 1, "params", "camera")


def proposed(database: Database, key: str, confidence: float) -> DriveLabels:
    """A recording of 100 frames, 50 of them with one proposal; in ten, the lead is unclear."""
    labels = DriveLabels(database, info(key), station="here")

    def proposals(draft: Any) -> str:
        draft.add("track", LabelTrack(1, "car", (), "proposed", PIPELINE, confidence=confidence))
        draft.put_sightings(1, {frame: Sighting(frame, AHEAD, None, False) for frame in range(50)})
        draft.add("lead", LeadRange(0, 9, "unknown", "proposed", PIPELINE))
        return "proposed"

    labels.log.act("propose", "Ada", proposals)
    return labels


def of(database: Database, key: str) -> Any:
    return next(each for each in queue(database) if each.key == key)


def test_what_is_least_sure_comes_first_and_what_is_done_last(database: Database) -> None:
    sure, unsure = f"sure {database.is_sqlite}", f"unsure {database.is_sqlite}"
    proposed(database, sure, 0.95)
    labels = proposed(database, unsure, 0.5)
    assert (of(database, sure).worth, of(database, unsure).worth) == (0.15, 0.6)
    order = [each.key for each in queue(database)]
    assert order.index(unsure) < order.index(sure)
    act(labels, "Ada", kind="set_lead", first=0, last=49, lead="none")
    put(database, unsure, "Bob", person="Ada")
    assert (of(database, unsure).state, of(database, unsure).person) == ("labeling", "Ada")
    put(database, unsure, "Ada", state="review")
    with pytest.raises(ActRefused, match="a second person must mark it as done"):
        put(database, unsure, "Ada", state="done")
    with pytest.raises(ActRefused, match="is not done: 1 proposal is open and 1 label is not reviewed"):
        put(database, unsure, "Bob", state="done")
    put(database, unsure, "Bob", state="done", anyway=True)
    done = of(database, unsure)
    assert (done.state, done.labelled, done.proposals, done.worth) == ("done", 0.5, 1, 0.5)
    order = [each.key for each in queue(database)]
    assert order.index(unsure) > order.index(sure)


def test_a_recording_is_done_once_every_proposal_is_judged_and_every_label_reviewed(database: Database) -> None:
    key = f"judged {database.is_sqlite}"
    labels = proposed(database, key, 0.5)
    act(labels, "Ada", kind="add_event", frame=3, event="cut_in")
    act(labels, "Ada", kind="accept", items=[("lead", 1)])

    def refused(left: str) -> None:
        with pytest.raises(ActRefused, match=f"is not done: {left}$"):
            put(database, key, "Bob", state="done")

    refused("1 proposal is open and 2 labels are not reviewed")
    act(labels, "Bob", kind="review_ok", items=[("lead", 1), ("event", 1)])
    refused("1 proposal is open")
    act(labels, "Ada", kind="reject", items=[("track", 1)])
    put(database, key, "Bob", state="done")
    assert (of(database, key).state, of(database, key).open_proposals, of(database, key).unreviewed) == ("done", 0, 0)


def test_what_nobody_has_labelled_is_not_reviewed_and_what_is_not_there_is_said(database: Database) -> None:
    key = f"bare {database.is_sqlite}"
    proposed(database, key, 0.5)
    with pytest.raises(ActRefused, match="nothing is labelled yet"):
        put(database, key, "Bob", state="review")
    with pytest.raises(NoSuchLabel, match="no such recordings"):
        put(database, "nowhere", "Bob", state="open")
    with pytest.raises(NoSuchLabel, match="such recordings; `cipv labels queue` lists them"):
        put(database, "a drive", "Bob", state="open")


def test_the_command_offers_the_states_that_there_are() -> None:
    assert get_args(Offered) == get_args(State)
