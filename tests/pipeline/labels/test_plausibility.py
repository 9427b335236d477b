"""Implausible labels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.registry import import_labels
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting
from pipeline.labels.plausibility import problems
from pipeline.sources import open_source
from tests.pipeline.labels.formats.sets import COUNT, drive

BY = Origin("person", "Ada", 1)
CAR = Cuboid((20.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.0)


def driven(number: int = 1, y_m: float = 0.0, **odd: Cuboid) -> LabelTrack:
    """A car that approaches by 0.5 m per frame, except in frames given as ``f2=…``."""
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
    assert found(track) == [(0, "#1 car: its box does not match its cuboid")]
    assert found(replace(track, sightings=(replace(track.sightings[0], box_set=False),))) == [], "one that follows is"


def test_a_labelled_street_is_plausible_and_what_is_put_wrong_in_it_is_found(data_dir: Path) -> None:
    """KITTI 0009: in each track, one cuboid is moved, turned or made longer."""
    folder = data_dir / "kitti_0009"
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    street = drive_of(open_source(f"kitti:{folder / '2011_09_26' / '2011_09_26_drive_0009_sync'}"))
    labels = import_labels(folder / "label_02.txt", street, "kitti-tracking", BY).labels
    assert problems(labels, street) == []
    wrong = {
        "it jumps": lambda car: car._replace(center=(car.center[0] + 0.6, *car.center[1:])),
        "it turns": lambda car: car._replace(yaw_rad=car.yaw_rad + 0.2),
        "its size": lambda car: car._replace(size=(car.size[0] + 0.4, *car.size[1:])),
    }
    for said, change in wrong.items():
        for track in (each for each in labels.tracks if len(each.sightings) > 4):
            middle = track.sightings[2]
            assert middle.cuboid is not None
            odd = replace(middle, cuboid=change(middle.cuboid))
            changed = replace(track, sightings=(*track.sightings[:2], odd, *track.sightings[3:]))
            words = [each.words for each in problems(replace(labels, tracks=(changed,)), street)]
            assert any(said in each for each in words), (said, track.id, words)
