"""Files that are cut, changed or made up to hurt: labels that can be, or one clear error."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from pipeline.alignment.projection import Pinhole, project_cuboid
from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid, inverse
from pipeline.labels.formats.base import LabeledDrive
from pipeline.labels.formats.registry import FORMATS, FormatName, export_labels, import_labels
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting
from pipeline.labels.validate import check
from tests.pipeline.labels.formats.sets import IMPORT, camera, drive
from tests.pipeline.labels.formats.test_round_trip import full_set
from tests.pipeline.sources.test_fuzz import EDITS, damaged

SCRATCH = count()


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "mcap"])
def test_damage(name: FormatName, tmp_path: Path) -> None:
    whole, here = tmp_path / "whole", drive()
    export_labels(full_set(), here, name, whole)
    files = [path for path in whole.rglob("*") if path.is_file()] or [whole]

    @settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(EDITS)
    def survives(edits: list[tuple[float, str, bytes]]) -> None:
        victim = files[next(SCRATCH) % len(files)]
        with tempfile.TemporaryDirectory() as scratch:
            hurt = Path(scratch) / "hurt"
            shutil.copytree(whole, hurt) if whole.is_dir() else shutil.copy(whole, hurt)
            place = hurt / victim.relative_to(whole) if whole.is_dir() else hurt
            place.write_bytes(damaged(victim.read_bytes(), edits))
            try:
                found = import_labels(hurt, here, name, IMPORT).labels
            except BadInput:
                return
            assert check(found, "labels").frames == here.frames

    survives()


HOSTILE = {
    "deep nesting": b"[" * 200_000,
    "a deep object": b'{"labels":' * 100_000,
    "a number without end": b'{"format":"cipv-labels","version":' + b"9" * 5000 + b"}",
    "no text": b"\xff\xfe\x00\x00",
    "a word": b"labels",
    "a list": b"[]",
    "null": b"null",
    "NaN": b'{"openlabel":{"metadata":{"schema_version":"1.0.0"},"x":NaN}}',
    "a frame beyond all": b"frame,lead\n99999999999999999999,1\n",
    "a field without end": b'frame,lead\n0,"' + b"x" * 200_000,
    "nul bytes": b"\x00" * 100,
}


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_files_give_one_clear_error(what: str, tmp_path: Path) -> None:
    file = tmp_path / "file.txt"
    file.write_bytes(HOSTILE[what])
    for name in FORMATS:
        with pytest.raises(BadInput) as refused:
            import_labels(file, drive(), name, IMPORT)
        assert "\n" not in str(refused.value)
        assert len(str(refused.value)) < 600


BY = Origin("person", "me", 1)
HERE = drive()


def of(*sightings: Sighting) -> LabelSet:
    return replace(HERE.empty(), tracks=(LabelTrack(1, "car", sightings, "accepted", BY),))


def at(
    center: tuple[float, float, float] = (9.0, 0.0, 0.0), size: tuple[float, float, float] = (4.0, 2.0, 1.0)
) -> Cuboid:
    return Cuboid(center, size, 0.0)


IMPOSSIBLE = {
    "no place": of(Sighting(0, at((float("nan"), 0.0, 0.0)))),
    "far beyond": of(Sighting(0, at((1e12, 0.0, 0.0)))),
    "no size": of(Sighting(0, at(size=(4.0, 0.0, 1.0)))),
    "a side beyond all measure": of(Sighting(0, at(size=(201.0, 2.0, 1.0)))),
    "a box inside out": of(Sighting(0, None, (10.0, 10.0, 5.0, 20.0))),
    "beyond the end": of(Sighting(6, at())),
    "backwards": of(Sighting(2, at()), Sighting(1, at())),
    "twice in a frame": of(Sighting(1, at()), Sighting(1, at())),
    "two of one id": replace(of(), tracks=of().tracks * 2),
    "leads that overlap": replace(
        of(), leads=(LeadRange(0, 3, 1, "accepted", BY), LeadRange(3, 4, "none", "accepted", BY))
    ),
    "a lead that ends before it begins": replace(of(), leads=(LeadRange(3, 1, 1, "accepted", BY),)),
    "frames without times": replace(of(), t_ns=()),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_labels_that_cannot_be_are_not_written(what: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="these labels: "):
        export_labels(IMPOSSIBLE[what], HERE, "native", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def seen_set(here: LabeledDrive) -> LabelSet:
    """Four cars with their boxes in the image."""
    eye = here.shots[0].camera
    assert eye is not None
    tracks = []
    for number, y_m in enumerate((-4.0, -1.0, 1.0, 4.0)):
        cuboid = Cuboid((25.0, y_m, 0.0), (4.0, 1.8, 1.5), 0.1)
        box = project_cuboid(Pinhole(eye.K, eye.distortion, eye.T_camera_ego), cuboid.corners(), eye.width, eye.height)
        assert box is not None
        tracks.append(LabelTrack(number, "car", (Sighting(0, cuboid, box, box_set=True),), "accepted", IMPORT))
    return replace(here.empty(), tracks=tuple(tracks))


def turned_round(here: LabeledDrive) -> LabeledDrive:
    """The same drive with an inverted extrinsic."""
    eye = here.shots[0].camera
    assert eye is not None
    wrong = replace(eye, T_camera_ego=inverse(eye.T_camera_ego))
    return replace(here, shots=tuple(replace(s, camera=wrong, T_rect_ego=wrong.T_camera_ego) for s in here.shots))


@pytest.mark.parametrize("name", ["kitti", "kitti-tracking", "nuscenes", "openlabel"])
def test_an_inverted_extrinsic_of_the_recording_is_detected(name: FormatName, tmp_path: Path) -> None:
    here = drive()
    with pytest.raises(BadInput, match="extrinsic inverted"):
        export_labels(seen_set(here), turned_round(here), name, tmp_path / "out")


@pytest.mark.parametrize("name", ["native", "openlabel", "kitti-tracking", "kitti"])
def test_labels_that_do_not_fall_where_their_boxes_are_are_refused(name: FormatName, tmp_path: Path) -> None:
    """As when the program that wrote them used the inverse of the extrinsic."""
    here = drive()
    labels = seen_set(here)
    export_labels(labels, here, name, tmp_path / "good")
    import_labels(tmp_path / "good", here, name, IMPORT)
    moved = tuple(
        replace(t, sightings=tuple(replace(s, cuboid=at((-3.0, 20.0, 9.0))) for s in t.sightings))
        for t in labels.tracks
    )
    export_labels(replace(labels, tracks=moved), here, name, tmp_path / "bad")
    with pytest.raises(BadInput, match="4 of 4 cuboids do not project onto their boxes"):
        import_labels(tmp_path / "bad", here, name, IMPORT)


def test_an_inverted_extrinsic_in_a_file_is_detected(tmp_path: Path) -> None:
    here = drive()
    export_labels(seen_set(here), here, "nuscenes", tmp_path / "nu")
    table = tmp_path / "nu/v1.0-cipv/calibrated_sensor.json"
    rows = json.loads(table.read_text())
    rows[-1]["rotation"] = [rows[-1]["rotation"][0], *(-v for v in rows[-1]["rotation"][1:])]
    table.write_text(json.dumps(rows))
    with pytest.raises(BadInput, match="does not look ahead"):
        import_labels(tmp_path / "nu", here, "nuscenes", IMPORT)
    export_labels(seen_set(here), here, "kitti", tmp_path / "kitti")
    file = tmp_path / "kitti/calib/000000.txt"
    eye = camera()
    wrong = " ".join(map(repr, np.asarray(inverse(eye.T_camera_ego)[:3]).ravel().tolist()))
    lines = [
        f"Tr_velo_to_cam: {wrong}" if line.startswith("Tr_velo") else line for line in file.read_text().splitlines()
    ]
    file.write_text("\n".join(lines))
    with pytest.raises(BadInput, match="does not look ahead"):
        import_labels(tmp_path / "kitti", here, "kitti", IMPORT)


def test_labels_of_another_recording_are_refused(tmp_path: Path) -> None:
    export_labels(full_set(), drive(), "native", tmp_path / "labels.json")
    export_labels(full_set(), drive(), "openlabel", tmp_path / "ol.json")
    other = replace(HERE, shots=tuple(replace(s, name=f"x{s.name}", t_ns=s.t_ns + 7) for s in HERE.shots))
    with pytest.raises(BadInput, match="of another recording"):
        import_labels(tmp_path / "labels.json", other, "native", IMPORT)
    with pytest.raises(BadInput, match="has another time"):
        import_labels(tmp_path / "ol.json", other, "openlabel", IMPORT)


def test_nothing_is_written_over(tmp_path: Path) -> None:
    for name in FORMATS.keys() - {"mcap"}:
        export_labels(full_set(), HERE, name, tmp_path / name)
        with pytest.raises(BadInput, match=r"file already exists|folder is not empty"):
            export_labels(full_set(), HERE, name, tmp_path / name)


def test_names_of_frames_that_are_no_file_names_are_not_used(tmp_path: Path) -> None:
    sneaky = replace(HERE, shots=tuple(replace(s, name=f"../{s.name}") for s in HERE.shots))
    labels = replace(seen_set(sneaky), frames=sneaky.frames)
    export_labels(labels, sneaky, "kitti", tmp_path / "out")
    assert sorted(p.name for p in tmp_path.rglob("*.txt")) == ["000000.txt", "000000.txt"]
