"""`cipv labels export` and `import`, as a person types them."""

from __future__ import annotations

import getpass
import json
import os
from pathlib import Path
from unittest.mock import Mock

import pytest

from app.cli import main
from pipeline.labels.formats.registry import FormatName
from pipeline.recording.session import source as session_source
from tests.pipeline.recording.frames import full, write


def cipv(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(each) for each in arguments])
    return int(ended.value.code or 0)


@pytest.fixture(autouse=True)
def database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A database without labels, used by this test only."""
    monkeypatch.setenv("CIPV_LABELS_URL", f"sqlite:///{tmp_path}/labels.db")


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    return write(tmp_path / "drive.mcap", [full(index) for index in range(3)])


def test_names_in_a_file_are_read_by_the_class_list(drive: Path, tmp_path: Path) -> None:
    classes = tmp_path / "labels.yaml"
    classes.write_text("classes: {car: , taxi: {of: car, exports: {coco: automobile}}}", encoding="utf-8")
    assert cipv("labels", "export", drive, "--format", "coco", "--out", tmp_path / "out.json") == 0
    file = tmp_path / "out.json"
    file.write_text(file.read_text().replace('"car"', '"automobile"'))
    more = ("--format", "coco", "--classes", classes, "--out", tmp_path / "in.json")
    assert cipv("labels", "import", drive, file, *more) == 0
    labels = json.loads((tmp_path / "in.json").read_text())
    assert {track["label"] for track in labels["labels"]["tracks"]} == {"taxi"}


def test_truth_goes_out_and_comes_back(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv("labels", "export", drive, "--format", "openlabel", "--out", tmp_path / "out.json") == 0
    assert "tracks 1, sightings 3, lead ranges 0" in capsys.readouterr().err
    file = tmp_path / "labels.json"
    assert cipv("labels", "import", drive, tmp_path / "out.json", "--format", "openlabel", "--out", file) == 0
    labels = json.loads(file.read_text())
    assert (labels["format"], labels["version"]) == ("cipv-labels", 5)
    assert [track["id"] for track in labels["labels"]["tracks"]] == [7]
    assert cipv("labels", "export", drive, "--labels", file, "--format", "csv", "--out", tmp_path / "lead.csv") == 0
    assert "cipv: 1 track not written: the format cannot hold them" in capsys.readouterr().err


def test_an_account_without_a_name_labels_under_its_number(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(getpass, "getuser", Mock(side_effect=KeyError("getpwuid(): uid not found: 1234")))
    monkeypatch.setattr(os, "getuid", lambda: 1234)
    assert cipv("labels", "export", drive, "--format", "openlabel", "--out", tmp_path / "out.json") == 0
    assert cipv("labels", "import", drive, tmp_path / "out.json", "--format", "openlabel") == 0
    capsys.readouterr()
    assert cipv("labels", "effort") == 0
    assert "account 1234" in capsys.readouterr().out


READ: dict[FormatName, tuple[int, int]] = {
    # sweeps and images that are decoded of a drive of three frames
    "native": (0, 0), "csv": (0, 0), "openlabel": (0, 0), "coco": (0, 0), "kitti": (0, 0), "kitti-tracking": (0, 0),
    "nuscenes": (3, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_a_format_does_not_need_is_not_read(
    name: FormatName, drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels = tmp_path / "labels.json"
    assert cipv("labels", "export", drive, "--format", "native", "--out", labels) == 0
    sweeps, images = Mock(wraps=session_source.sweep_from), Mock(wraps=session_source.image_from)
    monkeypatch.setattr(session_source, "sweep_from", sweeps)
    monkeypatch.setattr(session_source, "image_from", images)
    assert cipv("labels", "export", drive, "--labels", labels, "--format", name, "--out", tmp_path / "out") == 0
    assert (sweeps.call_count, images.call_count) == READ[name]


def test_the_same_recording_gives_the_same_file(drive: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert cipv("labels", "export", drive, "--format", "native", "--out", tmp_path / name) == 0
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_the_database_comes_before_the_truth_and_a_file_before_both(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cipv("labels", "list") == 0
    assert "no labels yet" in capsys.readouterr().err
    assert cipv("labels", "export", drive, "--format", "native", "--out", tmp_path / "truth.json") == 0
    labels = json.loads((tmp_path / "truth.json").read_text())
    labels["labels"]["tracks"][0]["label"] = "bus"
    (tmp_path / "other.json").write_text(json.dumps(labels))
    assert cipv("labels", "import", drive, tmp_path / "other.json", "--format", "native", "--person", "Ada") == 0
    assert "imported 1 tracks" in capsys.readouterr().err
    for name, options, label in (("a", (), "bus"), ("b", ("--labels", tmp_path / "truth.json"), "car")):
        assert cipv("labels", "export", drive, "--format", "native", "--out", tmp_path / name, *options) == 0
        found = json.loads((tmp_path / name).read_text())
        assert [track["label"] for track in found["labels"]["tracks"]] == [label]
    capsys.readouterr()
    assert cipv("labels", "list", "--json") == 0
    (listed,) = json.loads(capsys.readouterr().out)
    assert (listed["count"], listed["tracks"], listed["revision"]) == (3, 1, 1)
    moved = drive.rename(tmp_path / "moved.mcap")
    assert cipv("labels", "export", moved, "--format", "native", "--out", tmp_path / "c") == 0
    assert json.loads((tmp_path / "c").read_text())["labels"]["tracks"][0]["label"] == "bus"


def test_what_the_pipeline_saw_is_proposed(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv("labels", "propose", drive, "--lanes", "off") == 0
    assert "tracks in frames 1–3" in capsys.readouterr().err
    assert cipv("labels", "export", drive, "--format", "native", "--out", tmp_path / "a") == 0
    labels = json.loads((tmp_path / "a").read_text())["labels"]
    assert {each["state"] for each in (*labels["tracks"], *labels["leads"])} == {"proposed"}
    assert {each["origin"]["maker"] for each in labels["leads"]} == {"pipeline"}
    assert [(each["first"], each["last"]) for each in labels["leads"]] == [(0, 2)]


BAD = {
    "no such format": ("labels", "export", "{drive}", "--format", "word", "--out", "{tmp}/x"),
    "no such file": ("labels", "import", "{drive}", "{tmp}/none", "--format", "csv", "--out", "{tmp}/x"),
    "nobody's home": ("labels", "import", "{drive}", "~no_such_user_here/x", "--format", "csv", "--out", "{tmp}/x"),
    "nobody's labels": (
        "labels", "export", "{drive}", "--labels", "~no_such_user_here/x", "--format", "csv", "--out", "{tmp}/x",
    ),
    "no such recording": ("labels", "export", "{tmp}/none.mcap", "--format", "csv", "--out", "{tmp}/x"),
    "the other way": ("labels", "import", "{drive}", "{drive}", "--format", "coco", "--out", "{tmp}/x"),
    "a file that is there": ("labels", "export", "{drive}", "--format", "csv", "--out", "{drive}"),
    "no such version": ("labels", "export", "{drive}", "--version", "v9", "--format", "csv", "--out", "{tmp}/x"),
    "no database": ("labels", "list", "--database", "mysql://nowhere"),
    "a session without labels": ("labels", "import", "{drive}", "{drive}", "--format", "mcap", "--out", "{tmp}/x"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_one_sentence(what: str, drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv(*(each.format(drive=drive, tmp=tmp_path) for each in BAD[what])) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert said
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--assign", "Ada"), "--drive must be given together with --assign or --state"),
        (("--drive", "any"), "--drive must be given together with --assign or --state"),
        (("--drive", "any", "--assign", "Ada", "--anyway"), "--anyway must be given together with --state done"),
        (("--drive", "any", "--state", "review", "--anyway"), "--anyway must be given together with --state done"),
    ],
)
def test_an_option_without_what_it_needs_is_said(
    options: tuple[str, ...], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cipv("labels", "queue", *options) == 2
    assert why in capsys.readouterr().err
