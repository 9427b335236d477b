"""`cipv record`, `import`, `export`, `info` and `recover`, as they are typed."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import fsspec
import pytest
from rerun.chunk import RrdReader

from app.cli import main
from pipeline.common.files.data_dir import file_sha256
from pipeline.inference.model_registry import EMBEDDED, find
from pipeline.recording.info import info
from pipeline.recording.session.source import SessionSource
from pipeline.sources import open_source
from tests.conftest import ROOT
from tests.pipeline.recording.frames import ABOUT, full, same, write

LIDAR_ONLY = ("--lanes", "off")


def cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eleven frames of a simulated drive with their results."""
    out = tmp_path_factory.mktemp("recorded") / "drive.mcap"
    assert cipv("record", "sim:straight", "--out", out, "--seconds", 1, *LIDAR_ONLY) == 0
    return out


def test_record_keeps_inputs_results_parameters_and_labels(recorded: Path) -> None:
    session, source = SessionSource("a", str(recorded)), open_source("sim:straight")
    assert len(session) == 11
    for index in (0, 10):
        assert same(session.frame(index), source.frame(index))
        assert session.truth(index) == source.truth(index)
    result = session.result(10)
    assert result is not None
    assert result["objects"]
    assert session.params(10) is not None


def test_a_session_says_which_weights_its_results_are_of(recorded: Path) -> None:
    about, embedded = info(recorded).about, find(EMBEDDED)
    assert about is not None
    assert embedded is not None
    assert set(about.networks.values()) == {file_sha256(embedded)}


def test_record_names_a_file_in_a_folder_and_goes_on_in_another(tmp_path: Path) -> None:
    assert cipv("record", "sim:straight", "--out", tmp_path, "--seconds", 0.4, "--rotate-mb", 2, *LIDAR_ONLY) == 0
    files = sorted(tmp_path.iterdir())
    assert len(files) >= 2
    assert all(file.name.startswith("following-on-a-straight-motorway_") for file in files)
    assert sum(len(SessionSource("a", str(file))) for file in files) == 5


LONG_SCENE = """
title: a drive that outlasts the test
duration_s: 600
rate_hz: 10
road: {segments: [{length_m: 100}]}
ego: {lane: -1, speed_mps: {0: 0.01}}
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_record_closes_its_session_whoever_ends_it(number: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "long.yaml").write_text(LONG_SCENE)
    typed = ["record", f"sim:{tmp_path}/long.yaml", "--out", str(tmp_path / "a.mcap"), *LIDAR_ONLY]
    command = [sys.executable, "-c", "from app.cli import main; main()", *typed]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "Ctrl-C" not in process.stderr.readline():
            assert process.poll() is None
        os.kill(process.pid, number)
        said = process.stderr.read()
    assert process.returncode == 0
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert session.notes == ()
    assert 0 < len(session) < len(open_source(f"sim:{tmp_path}/long.yaml"))
    assert f"{len(session)} frames" in said


def test_import_makes_a_session_that_is_never_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = write(tmp_path / "a.mcap", [full(index) for index in range(3)])
    assert cipv("import", first, "--out", tmp_path / "b.mcap") == 0
    assert same(open_source(str(tmp_path / "b.mcap")).frame(2), full(2))
    assert cipv("import", first, "--out", tmp_path / "b.mcap") == 2
    assert "file already exists" in capsys.readouterr().err


def test_export_writes_a_clip_in_each_form(recorded: Path, tmp_path: Path) -> None:
    out = {kind: tmp_path / f"clip.{kind}" for kind in ("mcap", "csv", "rrd")}
    arguments = [argument for kind, path in out.items() for argument in (f"--{kind}", path)]
    assert cipv("export", recorded, "--from", 0.3, "--to", 0.6, *arguments, *LIDAR_ONLY) == 0
    clip = SessionSource("b", str(out["mcap"]))
    assert [clip.frame(k).name for k in range(len(clip))] == [f"{k:06d}" for k in (3, 4, 5, 6)]
    session = SessionSource("a", str(recorded))
    with out["csv"].open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = [(f"{k:06d}", each) for k in (3, 4, 5, 6) for each in (session.result(k) or {})["objects"]]
    assert len(rows) == len(expected)
    for row, (name, each) in zip(rows, expected, strict=True):
        assert (row["frame"], row["id"], row["source"]) == (name, str(each["id"]), each["source"])
        assert float(row["distance_m"]) == each["distance_m"]
    chunks = RrdReader(out["rrd"]).stream().to_chunks()
    assert {"/world/points", "/camera/image"} & {chunk.entity_path for chunk in chunks}


def test_export_of_a_session_without_results_runs_the_line(recorded: Path, tmp_path: Path) -> None:
    """The table computed from the inputs equals the table of the recorded results, since the pipeline is the same."""
    assert cipv("export", recorded, "--csv", tmp_path / "recorded.csv", *LIDAR_ONLY) == 0
    assert cipv("export", "sim:straight", "--to", 1, "--csv", tmp_path / "anew.csv", *LIDAR_ONLY) == 0
    assert (tmp_path / "recorded.csv").read_text() == (tmp_path / "anew.csv").read_text()


def test_info_prints_topics_rates_and_duration(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cipv("info", recorded) == 0
    said = capsys.readouterr().out
    assert "11 frames, 1.0 s, 10.00 Hz" in said
    row = next(line for line in said.splitlines() if line.startswith("/lidar/points"))
    assert row.split()[:4] == ["/lidar/points", "foxglove.PointCloud", "11", "10.00"]
    assert cipv("info", recorded, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["about"]["origin"] == "sim:straight"
    assert {topic["topic"]: topic["rhythm"]["count"] for topic in found["topics"]}["/results"] == 11
    assert {"/lidar/points", "/camera/image", "/tf", "/objects", "/ego", "/gnss", "/params"} <= {
        topic["topic"] for topic in found["topics"]
    }
    assert cipv("info", "sim:straight") == 0
    assert "10.00 Hz" in capsys.readouterr().out


def test_info_of_a_session_in_a_store(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = fsspec.filesystem("memory")
    store.pipe_file("/fleet/drive.mcap", recorded.read_bytes())
    try:
        assert cipv("info", "memory://fleet/drive.mcap") == 0
    finally:
        store.rm("/fleet", recursive=True)
    assert "11 frames, 1.0 s, 10.00 Hz" in capsys.readouterr().out


def test_info_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At 10 Hz, every fourth frame is missing."""
    path = write(tmp_path / "a.mcap", [full(index) for index in range(32) if index % 4 != 3])
    assert cipv("info", path) == 0
    said = capsys.readouterr().out
    assert "24 frames, 3.0 s, 7.67 Hz (usually 10.00), 7 gaps, the longest 0.20 s" in said


def test_recover_says_what_was_saved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = write(tmp_path / "a.mcap", [full(index) for index in range(3)])
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-400])
    assert cipv("info", cut) == 0
    assert "cipv recover" in capsys.readouterr().out
    assert cipv("recover", cut) == 0
    said = capsys.readouterr().out
    assert "cut_recovered.mcap" in said
    assert "3 frames" in said
    session = SessionSource("a", str(tmp_path / "cut_recovered.mcap"))
    assert (len(session), session.notes) == (3, ABOUT.notes)


WRONG = {
    "no such file": ("info", "nowhere.mcap"),
    "not one to recover": ("recover", "README.md"),
    "nothing to write": ("export", "sim:straight"),
    "nothing in between": ("export", "sim:straight", "--from", "500", "--csv", "x.csv"),
    "no such folder": ("import", "sim:straight", "--out", "no/such/folder/x.mcap"),
    "live sensors": ("import", "live:car.yaml", "--out", "x.mcap"),
}


@pytest.mark.parametrize("arguments", WRONG.values(), ids=WRONG)
def test_bad_input_is_said_in_one_line(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert cipv(*arguments) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert said[0].startswith("cipv: ")
