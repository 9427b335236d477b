"""A drive with proposals, for what people do with them."""

from __future__ import annotations

from typing import Any

import pytest

from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.common.geometry import Cuboid
from pipeline.labels.model import LabelTrack, LeadRange, Origin, Sighting
from tests.app.labels.conftest import fresh

PIPELINE = Origin("pipeline", "run 1", 1, "params", "camera")


@pytest.fixture
def labels(sqlite_database: Database) -> DriveLabels:
    """Track 1 is proposed in frames 10 to 20, and leads there; track 2 in 15 to 30."""
    labels = DriveLabels(sqlite_database, fresh(), station="here")

    def proposals(draft: Any) -> str:
        for number, frames in ((1, range(10, 21)), (2, range(15, 31))):
            draft.add("track", LabelTrack(number, "car", (), "proposed", PIPELINE))
            cuboid = Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0)
            draft.put_sightings(number, {f: Sighting(f, cuboid, (1.0, 2.0, 3.0, 4.0), False) for f in frames})
        draft.add("lead", LeadRange(10, 20, 1, "proposed", PIPELINE))
        return "proposed"

    labels.log.act("propose", "Ada", proposals)
    return labels
