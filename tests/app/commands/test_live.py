"""`cipv live`, `cipv replay` and `cipv run live:…` as a person types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from app.cli import main
from pipeline.sources.live.config import load
from tests.pipeline.sources.live.bench import endless
from tests.pipeline.sources.live.rig import Replaying, loopback_config


def ended(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return int(end.value.code or 0)


@pytest.fixture
def car(tmp_path: Path) -> Path:
    path = tmp_path / "car.yaml"
    path.write_text(yaml.safe_dump(loopback_config().model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    return path


def test_init_writes_a_file_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "new.yaml"
    assert ended("live", "init", str(path)) == 0
    assert load(str(path)).lidar is not None
    path.write_text("lidar: {}", encoding="utf-8")
    assert ended("live", "init", str(path)) == 2
    assert "file already exists" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == "lidar: {}"


def test_check_of_sensors_that_are_not_there_ends_with_1_and_says_why(
    car: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ended("live", "check", str(car), "--seconds", "0.6", "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert {sensor: each["state"] for sensor, each in told.items()} == dict.fromkeys(
        ("lidar", "camera", "gnss", "ego"), "absent"
    )
    assert "Connection refused" in told["camera"]["note"]
    assert told["lidar"]["rate_hz"] is None


def test_check_of_sensors_that_deliver_ends_with_0(car: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Replaying(load(str(car)), endless()):
        assert ended("live", "check", str(car), "--seconds", "1.5") == 0
    assert capsys.readouterr().out.count(" Hz") == 4


@pytest.mark.parametrize(
    "arguments",
    [
        ("live", "check", "nowhere.yaml"),
        ("live", "check", "nowhere.yaml", "--seconds", "0"),
        ("run", "live:nowhere.yaml"),
        ("serve", "live:nowhere.yaml"),
        ("replay", "sim:straight", "--config", "nowhere.yaml"),
        ("replay", "live:nowhere.yaml", "--config", "nowhere.yaml"),
        ("replay", "sim:straight", "--config", "nowhere.yaml", "--speed", "0"),
    ],
)
def test_bad_input_ends_with_2_and_one_line(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(*arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_run_of_live_sensors_writes_results_with_their_health(car: Path, tmp_path: Path) -> None:
    out = tmp_path / "results.jsonl"
    with Replaying(load(str(car)), endless()):
        assert ended("run", f"live:{car}", "--sensors", "lidar", "--frames", "12", "--out", str(out)) == 0
    results = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    assert len(results) == 12
    last = results[-1]["sensors"]
    assert last["lidar"]["points"] > 1000
    assert set(last) == {"lidar", "camera", "gnss", "ego"}
    assert all(each["state"] in ("ok", "stale") for each in last.values()), "stale for a moment on a busy machine"
    assert results[-1]["timing_ms"]["arrival"] > 40.0, "half a rotation at least"


def test_replay_sends_a_capture(car: Path, data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = f"pcap:{data_dir / 'vlp16_packets' / 'mrpt_sample_velodyne_vlp16_gps.pcap'}"
    assert ended("replay", capture, "--config", str(car)) == 0
    assert " lidar" in capsys.readouterr().err
    assert ended("replay", capture, "--config", str(car), "--speed", "2") == 2
