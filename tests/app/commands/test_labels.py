"""`cipv labels export` and `import`, as a person types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main
from tests.pipeline.recording.frames import full, write


def cipv(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(each) for each in arguments])
    return int(ended.value.code or 0)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    return write(tmp_path / "drive.mcap", [full(index) for index in range(3)])


def test_truth_goes_out_and_comes_back(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv("labels", "export", drive, "--format", "openlabel", "--out", tmp_path / "out.json") == 0
    assert "tracks 1, sightings 3, ranges of the lead 0" in capsys.readouterr().err
    file = tmp_path / "labels.json"
    assert cipv("labels", "import", drive, tmp_path / "out.json", "--format", "openlabel", "--out", file) == 0
    labels = json.loads(file.read_text())
    assert (labels["format"], labels["version"]) == ("cipv-labels", 1)
    assert [track["id"] for track in labels["labels"]["tracks"]] == [7]
    assert cipv("labels", "export", drive, "--labels", file, "--format", "csv", "--out", tmp_path / "lead.csv") == 0
    assert "cipv: 1 track not written: no place for them" in capsys.readouterr().err


def test_the_same_recording_gives_the_same_file(drive: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert cipv("labels", "export", drive, "--format", "native", "--out", tmp_path / name) == 0
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


BAD = {
    "no such format": ("labels", "export", "{drive}", "--format", "word", "--out", "{tmp}/x"),
    "no such file": ("labels", "import", "{drive}", "{tmp}/none", "--format", "csv", "--out", "{tmp}/x"),
    "no such recording": ("labels", "export", "{tmp}/none.mcap", "--format", "csv", "--out", "{tmp}/x"),
    "the other way": ("labels", "import", "{drive}", "{drive}", "--format", "coco", "--out", "{tmp}/x"),
    "a file that is there": ("labels", "export", "{drive}", "--format", "csv", "--out", "{drive}"),
    "a session without labels": ("labels", "import", "{drive}", "{drive}", "--format", "mcap", "--out", "{tmp}/x"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_one_sentence(what: str, drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv(*(each.format(drive=drive, tmp=tmp_path) for each in BAD[what])) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert said
    assert not (tmp_path / "x").exists()
