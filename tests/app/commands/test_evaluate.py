"""`cipv evaluate` as a person types it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from app.cli import main
from app.commands.evaluate import dashboard_link
from pipeline.labels.formats import native
from pipeline.labels.model import WHOLE_TAG, FrameTag, LabelSet, LabelTrack, LeadRange, Origin, Sighting
from pipeline.sources import open_source
from pipeline.types.source import Source

SOURCE = "sim:ccrb_50"
FRAMES = 12


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the LiDAR alone for the first frames of a drive."""
    file = tmp_path_factory.mktemp("ran") / "results.jsonl"
    with pytest.raises(SystemExit) as ended:
        main(["run", SOURCE, "--sensors", "lidar", "--frames", str(FRAMES), "--out", str(file)])
    assert ended.value.code == 0
    return file


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ground truth of those frames as a label file, with the lead labelled in all but the last three."""
    source = open_source(SOURCE)
    (key,) = {item.id for index in range(FRAMES) for item in source.truth(index) or ()}
    assert key is not None
    origin = Origin("person", "someone", 0)
    sightings = tuple(Sighting(n, (source.truth(n) or ())[0].cuboid) for n in range(FRAMES))
    stamps = tuple(source.t_ns(n) for n in range(FRAMES))
    labels = LabelSet(
        SOURCE,
        tuple(f"{n:06d}" for n in range(FRAMES)),
        stamps,
        (LabelTrack(key, "car", sightings, "accepted", origin),),
        (LeadRange(0, FRAMES - 4, key, "accepted", origin),),
    )
    file = tmp_path_factory.mktemp("labels") / "truth.json"
    file.write_bytes(native.to_json(labels))
    return file


def evaluate(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", *arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_results_against_the_simulators_truth(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate(SOURCE, "--results", str(results), "--json") == 0
    told = json.loads(capsys.readouterr().out)
    (drive,) = told["drives"]
    assert drive["judged"] == FRAMES
    assert any("have no result" in note for note in drive["notes"])
    shares = ("cipv_correct", "lead_missed", "cipv_false", "cipv_wrong")
    assert sum(told["figures"][name]["value"] for name in shares) == pytest.approx(100.0)


def test_results_against_a_file_of_labels(results: Path, truth: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate(SOURCE, "--results", str(results), "--truth", str(truth), "--json") == 0
    (drive,) = json.loads(capsys.readouterr().out)["drives"]
    assert (drive["frames"], drive["judged"]) == (FRAMES, FRAMES - 3)


def test_labels_of_a_sub_class_are_scored_as_its_parent(
    results: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    of_taxis, classes = tmp_path / "taxis.json", tmp_path / "labels.yaml"
    labels = native.from_json(truth.read_bytes(), "truth")
    (track,) = labels.tracks
    whole = FrameTag(0, FRAMES - 4, WHOLE_TAG, track.origin)
    of_taxis.write_bytes(native.to_json(replace(labels, tracks=(replace(track, label="taxi"),), tags=(whole,))))
    classes.write_text("classes: {car: , taxi: {of: car}}", encoding="utf-8")

    def recall(*more: str) -> float | None:
        assert evaluate(SOURCE, "--results", str(results), "--truth", str(of_taxis), "--json", *more) == 0
        return json.loads(capsys.readouterr().out)["figures"]["recall"]["value"]

    assert recall() is None, "nobody said what a taxi is"
    assert recall("--classes", str(classes)) is not None
    assert evaluate(SOURCE, "--truth", str(truth), "--classes", str(tmp_path / "none.yaml")) == 2
    classes.write_text("classes: [1, 2]", encoding="utf-8")
    assert evaluate(SOURCE, "--classes", str(classes)) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_a_report_that_compares_two_runs(
    results: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The other run never has a lead."""
    other = tmp_path / "other.jsonl"
    rows = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]
    other.write_text("".join(json.dumps({**row, "cipv": None}) + "\n" for row in rows), encoding="utf-8")
    page = tmp_path / "out" / "scores.html"
    files = ("--results", str(other), "--against", str(results), "--truth", str(truth))
    assert evaluate(SOURCE, *files, "--report", str(page), "--dashboard", "http://car.local:9000") == 0
    text = page.read_text(encoding="utf-8")
    assert "Compared with the baseline" in text
    assert "Worst frames" in text
    assert "CIPV correct" in capsys.readouterr().out
    links = re.findall(r'href="http://car\.local:9000/#([^"]+)"', text)
    opened = [parse_qs(link.replace("&amp;", "&")) for link in links]
    assert {query["uri"][0] for query in opened} == {SOURCE}
    assert {int(query["frame"][0]) for query in opened} <= set(range(FRAMES))


def test_the_line_with_two_sets_of_parameters(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The results above were computed with the base parameters, so they must score the same."""
    monkeypatch.setattr(
        "app.commands.support.options.SourceOptions.open", lambda options: _Short(open_source(options.source))
    )
    far = ("--set", "cipv.confirm_hits=20")
    assert evaluate(SOURCE, "--sensors", "lidar", *far, "--against", "default", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert evaluate(SOURCE, "--results", str(results), "--json") == 0
    alone = json.loads(capsys.readouterr().out)
    for name, figure in told["against"].items():
        assert figure["base"] == pytest.approx(alone["figures"][name]["value"], abs=1e-3), name
    assert told["against"]["acquired_m"]["run"] is None, "twenty sightings are more than there are frames"


class _Short:
    """The first frames of a source."""

    def __init__(self, source: Source) -> None:
        self.uri, self.title, self.rate_hz, self.notes = source.uri, source.title, source.rate_hz, source.notes
        self.frame, self.t_ns, self.truth = source.frame, source.t_ns, source.truth

    def __len__(self) -> int:
        return FRAMES


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param((), "at least one", id="nothing to evaluate"),
        pytest.param(("sim:nowhere",), "nowhere", id="no such recording"),
        pytest.param((SOURCE, "sim:straight", "--results", "one.jsonl"), "1 files for 2", id="a file too few"),
        pytest.param((SOURCE, "sim:straight", "--truth", "one.json"), "--truth", id="truth of one of two"),
        pytest.param((SOURCE, "--against", "a.jsonl", "b.jsonl"), "--against", id="a base too many"),
        pytest.param((SOURCE, "--results", "missing.jsonl"), "missing.jsonl", id="no such results"),
        pytest.param((SOURCE, "--truth", "missing.json"), "missing.json", id="no such labels"),
        pytest.param((SOURCE, "--max-range-m", "-1"), "--max-range-m", id="a range that is none"),
    ],
)
def test_bad_usage(
    arguments: tuple[str, ...],
    named: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert evaluate(*arguments) == 2
    (line,) = [each for each in capsys.readouterr().err.splitlines() if each.strip()][-1:]
    assert named in line


def test_labels_of_another_recording(truth: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = json.loads(truth.read_bytes())
    text["labels"]["t_ns"] = [each + 7 for each in range(FRAMES)]
    other = truth.with_name("other.json")
    other.write_text(json.dumps(text), encoding="utf-8")
    assert evaluate(SOURCE, "--truth", str(other)) == 2
    assert "another recording" in capsys.readouterr().err


def test_an_address_is_quoted_whole() -> None:
    assert dashboard_link("http://car.local:9000/", "astyx:/my drives/a&b", 7) == (
        "http://car.local:9000/#uri=astyx%3A%2Fmy%20drives%2Fa%26b&frame=7"
    )
