"""`cipv calibrate` as a person types it: a law is printed, written as parameters, kept with a network; an alignment is
fitted without a start."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from app.cli import main
from pipeline.common.geometry import rotation
from pipeline.inference.distance_laws import find_law
from pipeline.inference.model_registry import EMBEDDED, find
from pipeline.params import Params, from_yaml
from pipeline.sources import open_source
from pipeline.types.source import InParts
from tests.pipeline.sources.made.clouds_on_disk import pcd, rows_of

SCENE = """
title: cars ahead
duration_s: 1.0
rate_hz: 5
road: {segments: [{length_m: 1000}]}
ego: {lane: -2, speed_mps: {0: 10}}
actors:
  - {id: 1, kind: car, lane: -2, ahead_m: 18, speed_mps: {0: 10}}
  - {id: 2, kind: car, lane: -1, ahead_m: 30, speed_mps: {0: 10}}
  - {id: 3, kind: truck, lane: -3, ahead_m: 35, speed_mps: {0: 10}}
"""


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return f"sim:{path}"


@pytest.fixture
def network(tmp_path: Path) -> Path:
    """The embedded network's weights in a file that has no law yet."""
    embedded = find(EMBEDDED)
    assert embedded is not None
    return Path(shutil.copy(embedded, tmp_path / "copy.onnx"))


def calibrate(*arguments: str, what: str = "distance") -> int:
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", what, *arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_a_law_is_kept_with_the_network_it_was_fitted_to(
    scene: str, network: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "law.yaml"
    assert calibrate(scene, "--detector", str(network), "--keep", "--json", "--out", str(out)) == 0
    printed = json.loads(capsys.readouterr().out)
    law = find_law(network).law
    assert law is not None
    assert law.coefficient == pytest.approx(printed["car"]["law"]["coefficient"], abs=0.06)
    assert law.coefficient == pytest.approx(907.0 * 1.48, rel=0.1), "cars 1.48 m tall"
    assert law.truck_ratio == pytest.approx(3.8 / 1.48, rel=0.1)
    assert yaml.safe_load(out.read_text())["distance"]["coefficient"] == law.coefficient


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(["--keep"], "embedded", id="the program's own law"),
        pytest.param(
            ["--keep", "--detector", "NETWORK", "--set", "distance.scale_to_camera=false"],
            "scale_to_camera",
            id="a law of one camera only",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused(
    arguments: list[str], named: str, scene: str, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrate(scene, *[str(network) if each == "NETWORK" else each for each in arguments]) == 2
    assert named in capsys.readouterr().err
    assert find_law(network).law is None


def test_an_alignment_is_fitted_and_written_as_parameters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "turned.yaml", tmp_path / "alignment.yaml"
    path.write_text(SCENE + "detections: {boxes: {}}\nfaults: {camera_yaw_deg: 2.0, camera_pitch_deg: -1.5}\n")
    images = tmp_path / "images"
    more = ("--out", str(out), "--images", str(images), "--json")
    assert calibrate(f"sim:{path}", *more, what="alignment") == 0
    printed = capsys.readouterr()
    assert (
        yaml.safe_load(out.read_text())["alignment"]
        == {"model": "pinhole", "zoom": 1.0} | json.loads(printed.out)["values"]
    )
    fitted = from_yaml(out, Params()).alignment
    assert fitted.yaw_deg == pytest.approx(2.0, abs=0.3)
    assert fitted.pitch_deg == pytest.approx(-1.5, abs=0.3)
    assert "only" in printed.err, "one second of three cars"
    files = sorted(images.iterdir())
    assert f"{len(files)} images" in printed.err
    assert files
    assert all(cv2.imread(str(file)).shape == (720, 1280, 3) for file in files)


@pytest.mark.parametrize(
    ("what", "arguments"),
    [
        ("mount", ["--model", "angular"]),
        ("alignment", ["--keep"]),
        ("distance", ["--offset"]),
        ("time", ["--images", "folder"]),
        ("alignment", ["--offset", "--model", "angular"]),
    ],
)
def test_options_of_the_other_fit_are_refused(
    what: str, arguments: list[str], scene: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrate(scene, *arguments, what=what) == 2
    assert arguments[0] in capsys.readouterr().err


def test_a_mount_is_fitted_to_a_drive_and_corrected_by_its_rig_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive, turn = open_source("sim:curve_125"), rotation(*np.radians([0.0, 2.0, 3.0])).astype(np.float32)
    assert isinstance(drive, InParts)
    for index in range(60):
        sweep = drive.sweep(index)
        assert sweep is not None
        points = sweep.points.copy()
        points[:, :3] = points[:, :3] @ turn
        rows = rows_of(replace(sweep, points=points))
        rows["time"] = sweep.time_s
        (tmp_path / f"{index / drive.rate_hz:.3f}.pcd").write_bytes(pcd(rows))
    before, rig = f"pcd:{tmp_path}", tmp_path / "rig.yaml"
    assert calibrate(before, "--json", "--out", str(rig), what="mount") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["values"]["yaw_deg"] == pytest.approx(3.0, abs=0.6)
    assert calibrate(before, "--json", what="mount") == 0, "the rig file beside the sweeps is used"
    left = json.loads(capsys.readouterr().out)["values"]
    assert left["yaw_deg"] == pytest.approx(0.0, abs=0.6)
    assert left["pitch_deg"] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("what", ["distance", "alignment", "mount", "time"])
def test_a_preset_that_exists_is_refused_before_the_fit(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.yaml").write_text("by hand", encoding="utf-8")
    assert calibrate("no/such/recording", "--out", str(tmp_path / "mine.yaml"), what=what) == 2
    assert "mine.yaml: file already exists" in capsys.readouterr().err


def test_a_recording_with_its_own_mounts_takes_no_rig_file(
    scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrate(scene, "--out", str(tmp_path / "rig.yaml"), what="mount") == 2
    assert "own mounts" in capsys.readouterr().err
    assert calibrate(scene, what="mount") == 2
    assert "no yaw" in capsys.readouterr().err, "five frames"


def test_the_time_of_a_drive_is_told_and_written_as_parameters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], data_dir: Path
) -> None:
    out, drive = tmp_path / "sync.yaml", data_dir / "kitti_0009" / "2011_09_26" / "2011_09_26_drive_0009_sync"
    assert calibrate(f"kitti:{drive}", "--json", "--out", str(out), what="time") == 0
    printed = capsys.readouterr()
    camera = json.loads(printed.out)["camera"]
    assert abs(camera["camera_offset_ms"]) < 20.0, "its trigger was the LiDAR"
    assert from_yaml(out, Params()).sync.camera_offset_ms == camera["camera_offset_ms"]
    assert "ego speed" in printed.err, "five seconds"


def test_a_drive_that_tells_no_time_is_one_sentence(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate(scene, what="time") == 2
    assert "frames with an image" in capsys.readouterr().err
