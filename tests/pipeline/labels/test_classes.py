"""The class list of a project: read from its file, and in every export."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.fusion.vehicle_sizes import USUAL_SIZE_M
from pipeline.labels.classes import as_bases, as_written, default_classes, read_classes
from pipeline.labels.formats.registry import export_labels, import_labels
from pipeline.labels.model import LabelSet, LabelTrack, Sighting
from pipeline.types import VEHICLES
from tests.pipeline.labels.formats.sets import IMPORT, drive

AHEAD = Cuboid((20.0, 0.0, 0.7), (4.2, 1.8, 1.5), 0.0)


def labelled(*names: str) -> LabelSet:
    tracks = (
        LabelTrack(number, name, (Sighting(0, AHEAD._replace(center=(20.0, 4.0 * number, 0.7))),), "accepted", IMPORT)
        for number, name in enumerate(names, start=1)
    )
    return replace(drive().empty(), tracks=tuple(tracks))


def classes_of(path: Path, text: str):  # type: ignore[no-untyped-def]
    path.write_text(text, encoding="utf-8")
    return read_classes(path)


def test_the_programs_list_has_what_the_pipeline_knows_in_its_sizes() -> None:
    known = default_classes()
    assert known.classes.keys() >= USUAL_SIZE_M.keys()
    assert {name: known.classes[name].size for name in USUAL_SIZE_M} == USUAL_SIZE_M
    assert {known.base(name) for name in known.classes} <= VEHICLES | {"person", "bicycle", "trailer"}
    assert (known.named("Van"), known.named("Lorry"), known.base("van"), known.base("tram")) == (
        "van",
        "truck",
        "car",
        "tram",
    )


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("kitti", ["Van", "Truck", "Car"]), ("coco", ["car", "truck", "car"]), ("nuscenes", ["car", "truck", "car"])],
)
def test_sub_classes_are_written_as_a_format_calls_them(name: str, wanted: list[str]) -> None:
    written, notes = as_written(labelled("van", "semitrailer truck", "car"), default_classes(), name)
    assert [track.label.capitalize() if name == "kitti" else track.label for track in written.tracks] == wanted
    assert [note.split("class ")[1].split(" written")[0] for note in notes] == ["'semitrailer truck'", "'van'"]
    native, nothing = as_written(labelled("van"), default_classes(), "native")
    assert ([each.label for each in native.tracks], nothing) == (["van"], ())


def test_a_projects_own_list_is_what_its_exports_say(tmp_path: Path) -> None:
    own = classes_of(
        tmp_path / "labels.yaml",
        "classes:\n  car: {}\n  taxi: {of: car, size: [4.8, 1.9, 1.6], exports: {kitti: Taxi}}\n",
    )
    assert (own.attributes, own.classes["taxi"].size) == ({}, (4.8, 1.9, 1.6))
    lost = export_labels(labelled("taxi"), drive(), "kitti", tmp_path / "out", own)
    assert "1 track of class 'taxi' written as 'Taxi'" in lost
    rows = next((tmp_path / "out").rglob("000000.txt")).read_text(encoding="utf-8")
    assert rows.startswith("Taxi ")
    assert [track.label for track in as_bases(labelled("taxi", "bus"), own).tracks] == ["car", "bus"]
    export_labels(labelled("taxi"), drive(), "native", tmp_path / "a.json", own)
    back = import_labels(tmp_path / "a.json", drive(), "native", IMPORT).labels
    assert [track.label for track in back.tracks] == ["taxi"]


@pytest.mark.parametrize("name", ["kitti", "kitti-tracking", "coco", "nuscenes", "openlabel"])
def test_a_projects_names_in_a_file_are_read_back_as_its_classes(name: str, tmp_path: Path) -> None:
    own = classes_of(
        tmp_path / "labels.yaml",
        "classes: {car: , taxi: {of: car, exports: {kitti: Cab, coco: cab, nuscenes: vehicle.cab}}, van: {of: car}}",
    )
    export_labels(labelled("taxi", "car"), drive(), name, tmp_path / "out", own)
    back = import_labels(tmp_path / "out", drive(), name, IMPORT, own).labels
    assert sorted(track.label for track in back.tracks) == ["car", "taxi"]
    as_detectors = import_labels(tmp_path / "out", drive(), name, IMPORT).labels
    assert name == "openlabel" or "taxi" not in {track.label for track in as_detectors.tracks}
    assert (own.read_as("Van", name), own.read_as("Cyclist", name)) == ("van", None)


BILLIONS = "a: &a [1, 1]\n" + "".join(f"{b}: &{b} [*{a}, *{a}, *{a}]\n" for a, b in pairwise("abcdefghijklmnop"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[", "not YAML"),
        ("classes: !!timestamp x", "not YAML"),
        (BILLIONS, "aliases"),
        ("- car", "no classes"),
        ("classes: {}", "no classes"),
        ("classes: {van: {of: car}}", "van is of 'car', which is not a class"),
        ("classes: {car: , van: {of: car}, box van: {of: van}}", "itself a sub-class"),
        ("classes: {car: {size: [1, 2]}}", "car: invalid size"),
        ("classes: {car: {size: [.nan, 2, 1]}}", "car: invalid size"),
        ("classes: {car: {colour: red}}", "car: unknown entry 'colour'"),
        ("classes: {car: {exports: {waymo: CAR}}}", "car: unknown export 'waymo'"),
        ("classes: {car: }\nattributes: {lights: [on, off]}", "lights: values must be a list of quoted strings"),
        ("classes: {car: }\nmore: 1", "unknown entry 'more'"),
    ],
)
def test_a_file_that_is_none_is_said_in_a_sentence(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"labels\.yaml: ") as refused:
        classes_of(tmp_path / "labels.yaml", text)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_classes(tmp_path / "labels.yaml")
