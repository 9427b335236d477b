"""What is measured for a person becomes an act only when a person could have made it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.labels import measured
from app.labels.refusals import ActRefused
from app.labels.requests import Lift
from pipeline.geometry import Cuboid
from pipeline.labels.lift import Lifted
from pipeline.params import Params
from tests.app.recording import Recording


@pytest.mark.parametrize("size", [(201.0, 1.8, 1.5), (4.0, 0.00001, 1.5)], ids=["a wall", "a sheet"])
def test_points_that_are_no_vehicle_are_said(size: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    found = Lifted(Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0), None, 9, "laid on 9 points")
    act, frame = Lift(kind="lift", frame=0, pixel=(3.0, 3.0)), Recording().frame(0)
    monkeypatch.setattr(measured, "lift", lambda *_: found)
    assert measured.lifted(frame, Params(), act)[1] == "laid on 9 points"
    monkeypatch.setattr(measured, "lift", lambda *_: replace(found, cuboid=found.cuboid._replace(size=size)))
    with pytest.raises(ActRefused, match="no vehicle"):
        measured.lifted(frame, Params(), act)
