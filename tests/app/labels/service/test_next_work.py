"""Finding the next frame that needs work."""

from __future__ import annotations

from app.labels.service.next_work import Asked, where_next
from app.labels.service.scoring import LabelScores
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.labels.model import LeadRange, Origin
from tests.app.labels.acts.doing import act
from tests.app.labels.conftest import fresh


def test_what_is_only_proposed_is_not_labelled_yet(sqlite_database: Database) -> None:
    labels = DriveLabels(sqlite_database, fresh(), station="here")
    by = Origin("pipeline", "run 1", 1)
    labels.log.act("propose", "Ada", lambda draft: str(draft.add("lead", LeadRange(1, 5, "none", "proposed", by))))
    first, _, left = where_next(labels, LabelScores(), None, Asked("unlabelled", 0, 1))
    assert first is not None
    assert (first.frame, first.why, left) == (1, "lead only proposed", len(labels.info.t_ns))
    act(labels, kind="accept", items=[("lead", 1)])
    following, _, left = where_next(labels, LabelScores(), None, Asked("unlabelled", 0, 1))
    assert following is not None
    assert (following.frame, left) == (6, len(labels.info.t_ns) - 5)
