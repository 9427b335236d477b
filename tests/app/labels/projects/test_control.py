"""Frames with known truth: each person's labels against it."""

from __future__ import annotations

import pytest

from app.labels.projects.control import control_results, pack_truth
from app.labels.projects.project_file import ProjectEntries, ProjectFile
from app.labels.projects.results import ControlResult
from app.labels.projects.store import ControlSpan, put_project
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.common.geometry import Cuboid
from pipeline.labels.classes import default_classes
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting
from tests.app.labels.acts.doing import BOX, act
from tests.app.labels.conftest import fresh

SURE = Origin("import", "truth", 1)


def truth_of(labels: DriveLabels) -> LabelSet:
    """A car ahead that leads, and one beside it, in frames 0 to 9."""
    tracks = tuple(
        LabelTrack(
            number,
            "car",
            tuple(Sighting(frame, Cuboid((20.0, y, 0.7), (4.0, 1.8, 1.5), 0.0)) for frame in range(10)),
            "accepted",
            SURE,
        )
        for number, y in ((7, 0.0), (8, 4.0))
    )
    return LabelSet("test", labels.info.names(), labels.info.t_ns, tracks, (LeadRange(0, 9, 7, "accepted", SURE),))


def results(database: Database, labels: DriveLabels) -> dict[str, ControlResult]:
    found = control_results(database, default_classes())
    return {each.person: each for each in found if each.project == labels.info.key}


@pytest.fixture
def labels(database: Database) -> DriveLabels:
    """A recording in its own project, with control frames 2 to 5."""
    labels = DriveLabels(database, fresh(), station="here")
    key, span = labels.info.key, (2, 5)
    entries = ProjectEntries(name=key, drives=[key])
    put_project(
        database,
        ProjectFile(entries, "", ()),
        [key],
        [ControlSpan(key, *span, pack_truth(truth_of(labels), *span))],
        "Eve",
    )
    return labels


def test_only_what_a_person_labelled_in_these_frames_counts(database: Database, labels: DriveLabels) -> None:
    assert results(database, labels) == {}
    for frame in (1, 2, 3):
        act(labels, "Ada", kind="add_track", label="car", frame=frame, cuboid=BOX)
    act(labels, "Ada", kind="set_lead", first=0, last=2, lead=2)
    act(labels, "Bob", kind="set_lead", first=3, last=9, lead="none")
    act(labels, "Bob", kind="add_track", label="truck", frame=3, cuboid=BOX | {"center": [40.0, 0.0, 0.7]})
    found = results(database, labels)
    ada, bob = found["Ada"], found["Bob"]
    assert (ada.first, ada.last, ada.vehicles, ada.extra, ada.class_share) == (2, 5, 2, 0, 1.0)
    assert ada.iou == pytest.approx(1.0, abs=1e-3)
    assert ada.missed == bob.missed == 2, "the car beside, in both frames that anybody labelled"
    assert (ada.leads, ada.lead_share) == (1, 1.0), "frames 0 and 1 are no control frames"
    assert (bob.leads, bob.lead_share, bob.vehicles, bob.extra) == (3, 0.0, 0, 1)


def test_a_review_does_not_make_a_label_the_reviewers(database: Database, labels: DriveLabels) -> None:
    act(labels, "Ada", kind="set_lead", first=2, last=5, lead="none")
    (number,) = labels.items("lead")
    act(labels, "Bob", kind="review_ok", items=[("lead", number)])
    assert {person: each.lead_share for person, each in results(database, labels).items()} == {"Ada": 0.0}


def test_a_proposal_is_nobodys_result(database: Database, labels: DriveLabels) -> None:
    def proposal(draft: object) -> str:
        return str(draft.add("lead", LeadRange(2, 5, "none", "proposed", SURE)))  # type: ignore[attr-defined]

    labels.log.act("propose", "Ada", proposal)
    assert results(database, labels) == {}
