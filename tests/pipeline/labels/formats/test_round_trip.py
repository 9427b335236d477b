"""What a format can hold comes back as it was, and what it cannot is said."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.boxes import following
from pipeline.labels.formats import base, native
from pipeline.labels.formats.base import LabeledDrive
from pipeline.labels.formats.parts import EVERYTHING
from pipeline.labels.formats.registry import FORMATS, FormatName, export_labels, import_labels
from pipeline.labels.model import EventLabel, FrameTag, LabelSet, LabelTrack, LeadRange, Origin, PathLabel, Sighting
from pipeline.recording.rewrite import clip
from pipeline.recording.session.source import SessionSource
from pipeline.sources import open_source
from tests.pipeline.labels.formats.sets import IMPORT, assert_same, assert_same_alone, camera, drive, label_sets, plain
from tests.pipeline.recording.frames import full, write

SCRATCH = count()


def there_and_back(labels: LabelSet, here: LabeledDrive, name: FormatName, folder: Path) -> LabelSet:
    out = folder / f"{name}{next(SCRATCH)}"
    export_labels(labels, here, name, out)
    return import_labels(out, here, name, IMPORT).labels


def wanted(labels: LabelSet, name: FormatName) -> LabelSet:
    """The part of the labels that a format can hold, according to its registration."""
    holds = FORMATS[name].holds
    if "boxes" in holds and not FORMATS[name].as_stored:
        labels = following(labels, drive())
    if holds == EVERYTHING:
        return labels
    if holds == EVERYTHING - {"attributes"}:
        return replace(labels, tracks=tuple(replace(track, attributes=()) for track in labels.tracks))
    if "leads" in holds:
        return replace(plain(labels), tracks=(), leads=tuple(r for r in labels.leads if r.state != "rejected"))
    kept = plain(labels, cuboids="cuboids" in holds, boxes="boxes" in holds)
    return regions_named(kept, by_frame=name == "kitti") if name.startswith("kitti") else kept


def is_anonymous(name: FormatName) -> bool:
    """Whether the format does not say which sightings are of one track."""
    return "identities" not in FORMATS[name].holds and "leads" not in FORMATS[name].holds


def regions_named(labels: LabelSet, by_frame: bool) -> LabelSet:
    """Objects without a cuboid, in all frames or in one, become KITTI's ``DontCare`` regions."""
    tracks = []
    for track in labels.tracks:
        flat = [each for each in track.sightings if each.cuboid is None]
        if not by_frame:
            is_flat = len(flat) == len(track.sightings)
            tracks.append(replace(track, label="dont care") if is_flat else track)
            continue
        solid = tuple(each for each in track.sightings if each.cuboid is not None)
        tracks += [replace(track, sightings=(each,), label="dont care") for each in flat]
        tracks += [replace(track, sightings=solid)] if solid else []
    return replace(labels, tracks=tuple(tracks))


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "mcap"])
def test_what_can_be_held_comes_back(name: FormatName, monkeypatch: pytest.MonkeyPatch) -> None:
    # boxes and cuboids made up apart lie apart in the image; the check for that has tests of its own
    monkeypatch.setattr(base, "_FEWEST_PAIRS", 10**9)
    here = drive()

    @settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
    @given(label_sets())
    def holds(labels: LabelSet) -> None:
        if is_anonymous(name) and not plain(labels).tracks:
            return  # nothing labelled gives no file
        if name == "csv":
            labels = replace(labels, leads=_apart(labels.leads))
        with tempfile.TemporaryDirectory() as folder:
            same = assert_same_alone if is_anonymous(name) else assert_same
            same(there_and_back(labels, here, name, Path(folder)), wanted(labels, name), 2e-5)

    holds()


def _apart(leads: tuple[LeadRange, ...]) -> tuple[LeadRange, ...]:
    """Neighbouring ranges differ, since a table cannot distinguish one long range from two."""
    return tuple(replace(r, origin=replace(r.origin, name=f"by{i}")) for i, r in enumerate(leads))


@pytest.mark.parametrize("distortion", [(-0.3, 0.1, 0.001, 0.001), (-0.25, 0.08, 0.0, 0.0, 0.01)])
def test_kitti_boxes_are_of_the_undistorted_image(distortion: tuple[float, ...], tmp_path: Path) -> None:
    here = drive(camera(distortion))
    box = (100.0, 120.0, 300.0, 260.0)
    labels = replace(here.empty(), tracks=(LabelTrack(1, "car", (Sighting(0, None, box),), "accepted", IMPORT),))
    lost = export_labels(labels, here, "kitti", tmp_path / "out")
    assert any("undistorted" in each for each in lost)
    x1 = float((tmp_path / "out/label_2/000000.txt").read_text().split()[4])
    assert x1 < 90.0, "a barrel lens shows the edge nearer to the middle than it is"
    back = import_labels(tmp_path / "out", here, "kitti", IMPORT).labels
    assert back.tracks[0].sightings[0].bbox == pytest.approx(box, abs=1e-3)


def full_set() -> LabelSet:
    by = Origin("pipeline", "run", 5, "p", "c")
    seen = Sighting(0, Cuboid((20.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.1), (500.0, 300.0, 700.0, 420.0), box_set=True)
    tracks = (
        LabelTrack(
            3, "car", (seen, replace(seen, frame=1, keyframe=False)), "proposed", by, "look again", "", 0.625, "unknown"
        ),
        LabelTrack(4, "car", (replace(seen, frame=2, cuboid=None),), "rejected", by),
        LabelTrack(5, "bus", (replace(seen, frame=2, bbox=None),), "corrected", by, reviewer="Bob"),
        LabelTrack(6, "bus", (), "accepted", by),
    )
    return replace(
        drive().empty(),
        tracks=tracks,
        leads=(LeadRange(0, 1, 3, "accepted", by, "not yet", "Bob"), LeadRange(2, 3, "none", "rejected", by)),
        paths=(PathLabel(0, ((0.0, 1.0),), None, "accepted", by),),
        events=(EventLabel(1, "cut_in", (3,), "accepted", by),),
        tags=(FrameTag(0, 1, "rain", by),),
        name="frozen",
    )


LOSSES: dict[FormatName, tuple[str, ...]] = {
    "native": (),
    "openlabel": (),
    "kitti": (
        "2 ranges of the lead", "1 frame of the ego path", "1 event", "1 frame tag", "2 comments", "2 reviews",
        "1 track lose their identity", "1 interpolated position", "2 labels left out: rejected",
        "1 label written as if accepted", "1 corrected label", "who made each label", "'frozen'", "tracks' numbers",
        "1 track without sightings", "occlusion of 3 objects is unknown", "3 frames have no file",
    ),
    "kitti-tracking": ("2 ranges of the lead", "2 labels left out: rejected", "1 event", "who made each label"),
    "nuscenes": ("3 boxes in images not written", "1 sighting not written", "images and point"),
    "coco": ("3 cuboids not written", "1 frame tag"),
    "csv": ("4 tracks not written", "1 frame of the ego path", "1 rejected ranges", "'frozen'"),
}  # fmt: skip


@pytest.mark.parametrize("name", LOSSES)
def test_what_cannot_be_held_is_said(name: FormatName, tmp_path: Path) -> None:
    lost = export_labels(full_set(), drive(), name, tmp_path / "out")
    for said in LOSSES[name]:
        assert any(said in sentence for sentence in lost), (said, lost)
    if not LOSSES[name]:
        assert not lost


@pytest.mark.parametrize(("pitch_rad", "is_said"), [(0.04, True), (0.005, False)])
def test_the_tilt_of_kittis_cuboids_is_said(pitch_rad: float, is_said: bool, tmp_path: Path) -> None:
    lost = export_labels(full_set(), drive(camera(pitch_rad=pitch_rad)), "kitti", tmp_path / "out")
    assert any("the camera is tilted by" in sentence for sentence in lost) is is_said


def test_a_rejected_track_is_not_exported_as_true(tmp_path: Path) -> None:
    export_labels(full_set(), drive(), "kitti-tracking", tmp_path / "out")
    numbers = [line.split()[1] for line in (tmp_path / "out/label_02/0000.txt").read_text().splitlines()]
    assert numbers == ["3", "3", "5"]


def test_the_same_labels_give_the_same_bytes(tmp_path: Path) -> None:
    for name in FORMATS.keys() - {"mcap"}:
        for which in ("a", "b"):
            export_labels(full_set(), drive(), name, tmp_path / which / name)
        files = sorted(path for path in (tmp_path / "a" / name).rglob("*") if path.is_file())
        for path in files or [tmp_path / "a" / name]:
            assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()


def test_labels_of_a_drive_are_also_labels_of_its_clip() -> None:
    here = drive()
    clip = LabeledDrive(here.uri, here.shots[1:4])
    placed = native.onto(full_set(), clip, "labels")
    assert [(r.first, r.last, r.lead) for r in placed.labels.leads] == [(0, 0, 3), (1, 2, "none")]
    assert [(t.id, [s.frame for s in t.sightings]) for t in placed.labels.tracks] == [(3, [0]), (4, [1]), (5, [1])]
    assert [e.frame for e in placed.labels.events] == [0]
    assert placed.notes[0].startswith("3 of the labels' 6 frames")


def test_a_file_of_version_1_has_tags_of_single_frames() -> None:
    body = json.loads(native.to_json(full_set()))
    (tag,) = body["labels"]["tags"]
    single = {"frame": 1, "tag": tag["tag"], "origin": tag["origin"]}
    old = body | {"version": 1, "labels": body["labels"] | {"tags": [single]}}
    (read,) = native.from_json(json.dumps(old).encode(), "an old file").tags
    assert (read.first, read.last, read.tag) == (1, 1, "rain")
    with pytest.raises(BadInput, match="a new file"):
        native.from_json(json.dumps(old | {"version": 2}).encode(), "a new file")


def test_nuscenes_places_are_where_the_car_has_gone(tmp_path: Path) -> None:
    """A parked car ahead, seen from a car driving straight at 12 m/s, stays at its position in the global frame."""
    here = drive(yaw_rate_radps=0.0)
    seen = tuple(Sighting(i, Cuboid((30.0 - 1.2 * i, 2.0, 0.0), (4.0, 2.0, 1.5), 0.3)) for i in range(len(here.shots)))
    labels = replace(here.empty(), tracks=(LabelTrack(9, "car", seen, "accepted", IMPORT),))
    export_labels(labels, here, "nuscenes", tmp_path / "out")
    rows = json.loads((tmp_path / "out/v1.0-cipv/sample_annotation.json").read_text())
    assert [row["translation"] for row in rows] == [pytest.approx([30.0, 2.0, 0.0])] * len(seen)
    assert rows[0]["size"] == [2.0, 4.0, 1.5], "width, length, height"
    assert rows[0]["rotation"] == pytest.approx([0.988771, 0.0, 0.0, 0.149438], abs=1e-6), "w x y z"


def test_a_session_carries_its_labels(tmp_path: Path) -> None:
    session = write(tmp_path / "drive.mcap", [full(index) for index in range(4)])
    source = open_source(str(session))
    here = base.drive_of(source)
    by = Origin("person", "me", 5)
    seen = tuple(Sighting(i, Cuboid((20.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.1)) for i in range(len(source)))
    labels = replace(here.empty(), tracks=(LabelTrack(3, "car", seen, "accepted", by),))
    for version, out in (("first", "one.mcap"), ("second", "two.mcap")):
        export_labels(replace(labels, name=version), here, "mcap", tmp_path / out)
        here = base.drive_of(open_source(str(tmp_path / out)))
    found = import_labels(tmp_path / "two.mcap", here, "mcap", IMPORT).labels
    assert found.name == "second", "new labels take the place of those that were there"
    assert found.tracks == labels.tracks
    whole = SessionSource("", str(tmp_path / "two.mcap"))
    clip(whole, 1, len(source) - 1, tmp_path / "clip.mcap")
    part = base.drive_of(open_source(str(tmp_path / "clip.mcap")))
    in_clip = import_labels(tmp_path / "clip.mcap", part, "mcap", IMPORT).labels
    assert [s.frame for s in in_clip.tracks[0].sightings] == list(range(len(source) - 1))
