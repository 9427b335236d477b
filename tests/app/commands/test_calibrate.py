"""`cipv calibrate` as a person types it: a law is printed, written as parameters, kept with a network; an alignment is
fitted without a start."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import yaml

from app.cli import main
from pipeline.inference.distance_laws import find_law
from pipeline.inference.model_registry import EMBEDDED, find
from pipeline.params import Params, from_yaml

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
    assert calibrate(f"sim:{path}", "--out", str(out), "--json", what="alignment") == 0
    printed = capsys.readouterr()
    assert yaml.safe_load(out.read_text())["alignment"] == {"model": "pinhole", **json.loads(printed.out)["values"]}
    fitted = from_yaml(out, Params()).alignment
    assert fitted.yaw_deg == pytest.approx(2.0, abs=0.3)
    assert fitted.pitch_deg == pytest.approx(-1.5, abs=0.3)
    assert "only" in printed.err, "one second of three cars"


@pytest.mark.parametrize(
    ("what", "arguments"),
    [("alignment", ["--keep"]), ("distance", ["--offset"]), ("alignment", ["--offset", "--model", "angular"])],
)
def test_options_of_the_other_fit_are_refused(
    what: str, arguments: list[str], scene: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrate(scene, *arguments, what=what) == 2
    assert arguments[0] in capsys.readouterr().err
