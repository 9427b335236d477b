"""`cipv calibration` as a person types it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.cli import main
from pipeline.alignment.projection import Pinhole, resolve
from pipeline.formats.calibration_files import FORMATS
from pipeline.params import Params, with_changes
from pipeline.sources import open_source
from pipeline.sources.rig import load_rig


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["calibration", *arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_a_recordings_calibration_goes_through_every_format_with_its_correction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    turned = with_changes(Params(), {"alignment.yaw_deg": 1.5, "alignment.up_m": 0.1}).alignment
    options = ["--set", "alignment.yaw_deg=1.5", "--set", "alignment.up_m=0.1"]
    ros, opencv, rig = tmp_path / "ros", tmp_path / "opencv.yaml", tmp_path / "rig.yaml"
    assert run("sim:straight", "--to", "ros", "--out", str(ros), *options) == 0
    assert run(str(ros), "--format", "ros", "--to", "opencv", "--out", str(opencv)) == 0
    assert run(str(opencv), "--format", "opencv", "--out", str(rig)) == 0
    assert "1280×720" in capsys.readouterr().out
    ahead = np.array([[20.0, 1.0, 0.5], [40.0, -3.0, 1.0]])
    right = resolve(turned, open_source("sim:straight").frame(0).camera)
    found = resolve(Params().alignment, load_rig(rig).camera_calibration())
    assert right is not None
    assert found is not None
    np.testing.assert_allclose(found.project(ahead), right.project(ahead), atol=1e-3)


@pytest.mark.parametrize("to", ["rig", "opencv", "ros", "angular"])
def test_a_calibration_that_exists_is_never_overwritten(
    to: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = ("sim:straight", "--to", to, "--out", str(tmp_path / "mine"))
    assert run(*made) == 0
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    files[-1].write_text("measured by hand", encoding="utf-8")
    before = [path.read_bytes() for path in files]
    assert run(*made) == 2
    assert "file already exists; choose another name or remove it" in capsys.readouterr().err
    assert [path.read_bytes() for path in files] == before


def test_a_recordings_export_relates_to_the_lidar_of_its_files(data_dir: Path, tmp_path: Path) -> None:
    """As other tools use it: points of the LiDAR's files, projected with nothing but the exported file."""
    out = tmp_path / "astyx.yaml"
    assert run(f"astyx:{data_dir}/astyx", "--to", "opencv", "--out", str(out)) == 0
    camera = FORMATS["opencv"].read(out, None)
    file = min((data_dir / "astyx/lidar_vlp16").glob("*.txt"))
    own = np.loadtxt(file, skiprows=2)[:, :3]
    ahead = own[(own[:, 0] > 5.0) & (np.abs(own[:, 1]) < own[:, 0] / 4.0)]
    frame = open_source(f"astyx:{data_dir}/astyx").frame(0)
    aligned = resolve(Params().alignment, frame.camera)
    lidar = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    assert frame.sweep is not None
    assert aligned is not None
    shown = aligned.project(frame.sweep.points[:, :3].astype(np.float64))
    shown = shown[np.isfinite(shown).all(axis=1)]
    off_px = [np.abs(shown - each).max(axis=1).min() for each in lidar.project(ahead[::50])]
    assert max(off_px) < 0.5


def test_kittis_raw_calibration_is_read_from_the_folder_of_a_day(data_dir: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    day = data_dir / "kitti_0009/2011_09_26"
    assert run(str(day), "--format", "kitti", "--to", "opencv", "--out", str(out)) == 0
    assert (FORMATS["opencv"].read(out, None).width, FORMATS["opencv"].read(out, None).height) == (1242, 375)


def test_a_format_that_lacks_something_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "calib.txt").write_text("P2: 1")
    assert run(str(tmp_path / "calib.txt"), "--format", "kitti", "--out", str(tmp_path / "out.yaml")) == 2
    assert "image size" in capsys.readouterr().err


def test_one_model_becomes_the_best_fit_of_the_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    angular, rig = tmp_path / "angular.yaml", tmp_path / "rig.yaml"
    assert run("sim:straight", "--to", "angular", "--out", str(angular)) == 0
    assert "0–5°" in capsys.readouterr().out, "the cost is said"
    assert run("sim:straight", "--params", str(angular), "--to", "rig", "--out", str(rig)) == 0
    ahead = np.array([[20.0, 1.0, 0.0], [40.0, -3.0, 0.5]])
    right = resolve(Params().alignment, open_source("sim:straight").frame(0).camera)
    found = resolve(Params().alignment, load_rig(rig).camera_calibration())
    assert right is not None
    assert found is not None
    assert np.abs(found.project(ahead) - right.project(ahead)).max() < 25.0
