"""A measured shape is stored only if a person could have drawn it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.labels.acts import measured
from app.labels.acts.requests import AddTrack, Lift, Refit
from app.labels.errors import ActRefused
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboid_from_pixel import Lifted
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording
from tests.app.labels.conftest import fresh
from tests.app.labels.doing import act


@pytest.mark.parametrize("size", [(201.0, 1.8, 1.5), (4.0, 0.00001, 1.5)], ids=["a wall", "a sheet"])
def test_points_that_are_no_vehicle_are_said(size: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    found = Lifted(Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0), None, 9, "laid on 9 points")
    act, frame = Lift(kind="lift", frame=0, pixel=(3.0, 3.0)), Recording().frame(0)
    monkeypatch.setattr(measured, "lift", lambda *_: found)
    assert measured.lifted(frame, Params(), act)[1] == "laid on 9 points"
    monkeypatch.setattr(measured, "lift", lambda *_: replace(found, cuboid=found.cuboid._replace(size=size)))
    with pytest.raises(ActRefused, match="not a vehicle"):
        measured.lifted(frame, Params(), act)


def test_what_only_the_image_shows_is_laid_on_points_but_not_put_where_its_height_says(
    sqlite_database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels, box = DriveLabels(sqlite_database, fresh(), "here"), (10.0, 10.0, 40.0, 30.0)
    act(labels, "Ada", AddTrack(kind="add_track", label="car", frame=0, bbox=box))
    snap, frame = Refit(kind="refit", track=1, revision=1, frame=0), Recording().frame(0)
    found = Lifted(Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0), box, 9, "fitted to the 9 points there")
    monkeypatch.setattr(measured, "lift", lambda *asked: found if asked[2:] == ("car", box) else None)
    placed, note = measured.refitted(labels, frame, Params(), snap)
    assert (placed.sighting().cuboid, placed.bbox) == (found.cuboid, box)
    assert note == f"{found.how}; check its front (Shift X reverses it)", "a fit to points does not tell it"
    rough = replace(found, points=0, how="no points there: about 68 ± 8 m judging by its height in the image")
    monkeypatch.setattr(measured, "lift", lambda *_: rough)
    with pytest.raises(ActRefused, match=r"#1: no points there: about 68 ± 8 m .* too rough for a label: draw it"):
        measured.refitted(labels, frame, Params(), snap)
