"""The alignment is found without a start, its uncertainty is about right, and what a drive cannot tell is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.calibration.alignment.fit import BLOCK_NS, HELD_OUT, NothingToFit, fit_alignment, overlap_sentence
from pipeline.calibration.alignment.scenes import FitScene, fit_scene
from pipeline.calibration.alignment.solve import SHARED_DEG, SHARED_WITH_PLACE
from pipeline.common.geometry import inverse, rotation
from pipeline.params import AlignmentParams, Params, with_changes
from pipeline.sources import open_source
from pipeline.types import CameraCalibration
from tests.looking import yolox_nano
from tests.pipeline.calibration.alignment.made_drive import CAMERA, drive


def made(camera: CameraCalibration | None = CAMERA, **true: float | str) -> list[FitScene]:
    params = with_changes(Params(), {f"alignment.{name}": value for name, value in true.items()}).alignment
    aligned = resolve(params, CAMERA)
    assert aligned is not None
    return drive(aligned, camera=camera)


@pytest.mark.parametrize(
    "true", [{"yaw_deg": 4.3, "pitch_deg": -3.7, "roll_deg": 2.0}, {"yaw_deg": -7.4, "pitch_deg": 5.1, "roll_deg": 0.0}]
)
def test_a_turned_mount_is_found_without_a_start(true: dict[str, float]):
    fit = fit_alignment(made(**true), "pinhole", AlignmentParams())
    for name, value in true.items():
        assert fit.values[name] == pytest.approx(value, abs=0.15 if name != "roll_deg" else 0.4)
        assert abs(fit.values[name] - value) < 4.0 * fit.sigmas[name] + 0.02
        assert fit.sigmas[name] >= SHARED_DEG.get(name, 0.0), "what all frames share does not average out"
    assert fit.before is not None
    assert fit.after.mean_iou > max(0.8, fit.before.mean_iou + 0.3)
    assert fit.held_out
    assert fit.warnings == ()


def test_a_camera_that_sits_elsewhere_is_found():
    true = {"yaw_deg": 1.3, "pitch_deg": 0.6, "left_m": 0.25, "up_m": -0.2}
    fit = fit_alignment(made(**true), "pinhole", AlignmentParams(), offset=True)
    assert fit.values["left_m"] == pytest.approx(0.25, abs=0.06)
    assert fit.values["up_m"] == pytest.approx(-0.2, abs=0.06)
    assert fit.values["yaw_deg"] == pytest.approx(1.3, abs=0.3)
    assert all(fit.sigmas[name] >= shared for name, shared in SHARED_WITH_PLACE.items())


def test_angles_alone_are_fitted_to_the_position_that_the_camera_has():
    place = {"forward_m": -0.3, "left_m": 0.4, "up_m": -0.3}
    fit = fit_alignment(made(yaw_deg=1.3, pitch_deg=0.6, **place), "pinhole", AlignmentParams(**place))
    assert fit.values["yaw_deg"] == pytest.approx(1.3, abs=0.15)
    assert fit.values["pitch_deg"] == pytest.approx(0.6, abs=0.15)
    assert fit.after.mean_iou > 0.8
    assert {name: fit.changes[f"alignment.{name}"] for name in place} == place, "a file of the fit has them, too"


def test_a_fit_that_held_out_frames_contradict_is_doubted():
    turned, plain = made(yaw_deg=2.0), made()
    blocks = sorted({each.t_ns // BLOCK_NS for each in turned})
    held = blocks[HELD_OUT // 2 :: HELD_OUT]
    mixed = [own if own.t_ns // BLOCK_NS in held else other for own, other in zip(plain, turned, strict=True)]
    said = "held-out frames cover each other less"
    assert any(said in each for each in fit_alignment(mixed, "pinhole", AlignmentParams()).warnings)
    assert not any(said in each for each in fit_alignment(turned, "pinhole", AlignmentParams()).warnings)


ANGULAR = {"model": "angular", "h_res_deg": 0.062, "v_res_deg": 0.063, "cx_px": 690.0, "cy_px": 230.0}


@pytest.mark.parametrize("camera", [CAMERA, None], ids=["calibrated", "unknown lens"])
def test_the_angular_model_needs_no_calibration(camera: CameraCalibration | None):
    fit = fit_alignment(made(camera, **ANGULAR), "angular", AlignmentParams())
    assert fit.values["h_res_deg"] == pytest.approx(0.062, rel=0.01)
    assert fit.values["v_res_deg"] == pytest.approx(0.063, rel=0.02)
    assert fit.values["cx_px"] == pytest.approx(690.0, abs=4.0)
    assert fit.values["cy_px"] == pytest.approx(230.0, abs=4.0)
    assert (fit.before is None) == (camera is None)
    applied = with_changes(Params(), fit.changes)
    assert applied.alignment.model == "angular"


def test_what_the_drive_lacks_is_said():
    aligned = resolve(AlignmentParams(), CAMERA)
    assert aligned is not None
    alike = drive(aligned, frames=30, cars=1, walls=1, ranges_m=(20.0, 22.0), bearing_deg=2.0)
    said = " ".join(fit_alignment(alike, "pinhole", AlignmentParams()).warnings)
    assert "angle and offset cannot be told apart" in said
    assert "one direction" in said
    assert "only" in said


@pytest.mark.parametrize(
    ("cars", "frames", "said"), [(0, 20, "more traffic"), (1, 4, "more traffic"), (0, 0, "no frame")]
)
def test_nobody_ahead_is_no_fit(cars: int, frames: int, said: str):
    aligned = resolve(AlignmentParams(), CAMERA)
    assert aligned is not None
    with pytest.raises(NothingToFit, match=said):
        fit_alignment(drive(aligned, frames=frames, cars=cars, walls=1), "pinhole", AlignmentParams())


def test_without_a_calibration_there_is_no_pinhole_model():
    with pytest.raises(NothingToFit, match="angular"):
        fit_alignment(made(None), "pinhole", AlignmentParams())


@pytest.mark.parametrize("are_undistorted", [True, False])
def test_undistorted_images_with_the_distortion_of_raw_ones_are_noticed(are_undistorted: bool):
    bent = replace(CAMERA, distortion=np.array([-0.35, 0.15, 0.0, 0.0]))
    seen = resolve(AlignmentParams(), CAMERA if are_undistorted else bent)
    assert seen is not None
    warnings = fit_alignment(drive(seen, camera=bent), "pinhole", AlignmentParams()).warnings
    assert any("already undistorted" in each for each in warnings) == are_undistorted


@pytest.mark.parametrize(("given_deg", "is_noticed"), [(np.radians(4.0), True), (4.0, False), (0.0, False)])
def test_a_mount_in_radians_where_degrees_are_expected_is_noticed(given_deg: float, is_noticed: bool):
    """The camera looks 4° down and 3° to the left."""

    def mounted(pitch_deg: float, yaw_deg: float) -> CameraCalibration:
        turn = np.eye(4)
        turn[:3, :3] = rotation(*np.radians([0.0, pitch_deg, yaw_deg]))
        return replace(CAMERA, T_camera_ego=CAMERA.T_camera_ego @ inverse(turn))

    true = resolve(AlignmentParams(), mounted(4.0, 3.0))
    assert true is not None
    scenes = drive(true, camera=mounted(given_deg, given_deg * 0.75))
    warnings = fit_alignment(scenes, "pinhole", AlignmentParams()).warnings
    assert any("look like radians" in each for each in warnings) == is_noticed


def test_a_fit_in_words():
    fit = fit_alignment(made(), "pinhole", AlignmentParams())
    assert "boxes of held-out frames" in overlap_sentence(fit)
    assert "too short" in overlap_sentence(replace(fit, held_out=False, before=None))


def test_a_fit_can_be_ended():
    class Ended(Exception):
        pass

    def ended(done: int, total: int) -> None:
        assert done < total
        raise Ended

    with pytest.raises(Ended):
        fit_alignment(made(), "pinhole", AlignmentParams(), progress=ended)


def test_two_seconds_of_real_traffic_undo_a_wrong_calibration(data_dir: Path):
    source, detector = open_source(f"kitti:{data_dir / 'kitti_0052'}"), yolox_nano(data_dir, 1242, 375)
    scenes = []
    for index in range(len(source)):
        frame = source.frame(index)
        assert frame.image is not None
        assert frame.camera is not None
        turn = np.eye(4)
        turn[:3, :3] = rotation(*np.radians([0.0, 3.0, -4.0]))
        wrong = replace(frame.camera, T_camera_ego=frame.camera.T_camera_ego @ turn)
        seen = replace(frame, camera=wrong, raw_boxes=detector.detect(frame.image.bgr))
        scene = fit_scene(seen, Params())
        assert scene is not None
        scenes.append(scene)
    fit = fit_alignment(scenes, "pinhole", AlignmentParams())
    found = resolve(with_changes(Params(), fit.changes).alignment, scenes[0].camera)
    right = inverse(source.frame(0).camera.T_camera_ego)[:3, 2]  # type: ignore[union-attr]
    _, axis = found.rays(source.frame(0).camera.K[:2, 2][None])  # type: ignore[union-attr]
    off_deg = np.degrees(np.arctan2(np.cross(right, axis[0]), right @ axis[0]))
    assert np.abs(off_deg[1:]).max() < 0.3, "pitch and yaw"
