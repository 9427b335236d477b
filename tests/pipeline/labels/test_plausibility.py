"""What in labels can hardly be so."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting
from pipeline.labels.plausibility import problems
from tests.pipeline.labels.formats.sets import COUNT, drive

BY = Origin("person", "Ada", 1)
CAR = Cuboid((20.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.0)


def driven(number: int = 1, y_m: float = 0.0, **odd: Cuboid) -> LabelTrack:
    """A car that comes nearer by 0.5 m a frame, but where ``f2=…`` says otherwise."""
    sightings = []
    for frame in range(COUNT):
        x, _, z = CAR.center
        usual = CAR._replace(center=(x - 0.5 * frame, y_m, z))
        sightings.append(Sighting(frame, odd.get(f"f{frame}", usual)))
    return LabelTrack(number, "car", tuple(sightings), "accepted", BY)


def found(*tracks: LabelTrack, leads: tuple[LeadRange, ...] = ()) -> list[tuple[int, str]]:
    labels: LabelSet = replace(drive().empty(), tracks=tracks, leads=leads)
    return [(each.frame, each.words) for each in problems(labels, drive())]


def test_a_car_that_drives_on_and_one_beside_it_are_plausible() -> None:
    assert found(driven(), driven(2, 4.0), leads=(LeadRange(0, COUNT - 1, 1, "accepted", BY),)) == []


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (CAR._replace(center=(19.5, 0.0, 0.5), size=(6.0, 1.8, 1.5)), "its size jumps by 2.0 m"),
        (CAR._replace(center=(19.5, 0.0, 0.5), yaw_rad=0.6), "it turns by 34° in 0.1 s"),
        (CAR._replace(center=(23.0, 0.0, 0.5)), "it jumps by 3.5 m"),
    ],
)
def test_jumps_are_found_where_they_are(odd: Cuboid, said: str) -> None:
    assert (1, f"#1 car: {said}") in found(driven(f1=odd))


def test_two_in_one_place_overlap() -> None:
    assert found(driven(), driven(2, 0.9))[0] == (0, "#1 car and #2 car overlap")
    for state in ("rejected", "proposed"):
        assert found(driven(), replace(driven(2, 0.9), state=state)) == [], "nobody stands behind that"


def test_a_lead_is_there_and_ahead_of_us() -> None:
    behind = CAR._replace(center=(-5.0, 0.0, 0.5))
    gone = driven()
    gone = replace(gone, sightings=gone.sightings[:2])
    lead = LeadRange(0, COUNT - 1, 1, "accepted", BY)
    assert (2, "the lead is #1, which is not in this frame") in found(gone, leads=(lead,))
    away = replace(driven(), sightings=tuple(replace(each, cuboid=behind) for each in driven().sightings))
    assert found(away, leads=(lead,)) == [(0, "the lead is #1, which is behind the ego vehicle")]
    assert found(leads=(lead,)) == [(0, "the lead is #1, which is not labelled")]


def test_a_box_that_somebody_set_elsewhere_is_found() -> None:
    track = LabelTrack(1, "car", (Sighting(0, CAR, (5.0, 5.0, 60.0, 50.0), box_set=True),), "accepted", BY)
    assert found(track) == [(0, "#1 car: its box is not where its cuboid is")]
    assert found(replace(track, sightings=(replace(track.sightings[0], box_set=False),))) == [], "one that follows is"
