"""The truth of a recording as labels."""

from __future__ import annotations

from pathlib import Path

from pipeline.labels.model import Origin
from pipeline.labels.recorded_truth import truth_labels
from pipeline.labels.validate import check
from pipeline.sources import TruthObject, open_source
from tests.pipeline.recording.frames import TRUTH, full, write

BY = Origin("import", "truth", 1)


def test_objects_with_an_id_are_followed(tmp_path: Path) -> None:
    source = open_source(str(write(tmp_path / "drive.mcap", [full(index) for index in range(3)])))
    labels, notes = truth_labels(source, ("a", "b", "c"), BY)
    (track,) = check(labels, "labels").tracks
    assert (track.id, track.label, track.state) == (7, "car", "accepted")
    assert [(s.frame, s.cuboid) for s in track.sightings] == [(i, TRUTH[0].cuboid) for i in range(3)]
    assert notes == ()


def test_what_is_not_known_is_said(tmp_path: Path) -> None:
    source = open_source(str(write(tmp_path / "drive.mcap", [full(index) for index in range(3)])))

    class Partly:
        """The middle frame is not labelled; in the others, objects have no ids."""

        uri = source.uri
        t_ns = source.t_ns

        def truth(self, index: int) -> tuple[TruthObject, ...] | None:
            return None if index == 1 else (TruthObject("van", TRUTH[0].cuboid),)

    labels, notes = truth_labels(Partly(), ("a", "b", "c"), BY)  # type: ignore[arg-type]
    assert [(t.id, t.label, [s.frame for s in t.sightings]) for t in labels.tracks] == [
        (1, "car", [0, 2]),
    ]
    assert notes[0] == "1 of 3 frames are not labelled"
    assert "linked from frame to frame by distance" in notes[1]


def test_the_simulator_knows_who_is_who() -> None:
    source = open_source("sim:cut_in")
    labels, notes = truth_labels(source, tuple(str(i) for i in range(20)), BY)
    assert notes == ()
    assert max(len(track.sightings) for track in labels.tracks) == 20
