"""The alignment score peaks at the true mount, falls on all sides, and is None where nothing can be determined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.calibration.depth_edges import EdgeScene, edge_scene, scene_of
from pipeline.calibration.edge_match import FEWEST, EdgeScore, Seen, edge_score
from pipeline.params import AlignmentParams, Params, with_changes
from pipeline.sources import open_source
from pipeline.types import F64, CameraCalibration


def looked_at(uri: str, frames: Sequence[int]) -> list[Seen]:
    source, found = open_source(uri), []
    for index in frames:
        frame = source.frame(index)
        assert frame.sweep is not None
        assert frame.image is not None
        found.append((edge_scene(frame.sweep, frame.image.bgr), frame.camera))
    return found


@pytest.fixture(scope="module")
def astyx(data_dir: Path) -> list[Seen]:
    return looked_at(f"astyx:{data_dir / 'astyx'}", range(0, 39, 2))


@pytest.fixture(scope="module")
def kitti(data_dir: Path) -> list[Seen]:
    return looked_at(f"kitti:{data_dir / 'kitti_0052'}", range(0, 23, 2))


@pytest.fixture(params=["astyx", "kitti"])
def drive(request: pytest.FixtureRequest) -> list[Seen]:
    """A real VLP-16, and an HDL-64 thinned to its rings."""
    found: list[Seen] = request.getfixturevalue(request.param)
    return found


def with_mount(**corrections: float | str) -> AlignmentParams:
    return with_changes(Params(), {f"alignment.{name}": value for name, value in corrections.items()}).alignment


def test_the_true_mount_of_a_real_car_is_the_best(drive: list[Seen]):
    found = edge_score(drive, with_mount())
    assert found.score is not None
    assert found.score > 0.95
    assert found.better == {}


@pytest.mark.parametrize(
    ("name", "way", "steps_deg"),
    [(name, way, steps) for name, steps in (("yaw_deg", (0.5, 2, 3)), ("pitch_deg", (1, 3))) for way in (-1, 1)],
)
def test_a_turned_mount_scores_less_and_the_way_back_is_told(
    drive: list[Seen], name: str, way: int, steps_deg: tuple[float, ...]
):
    scores = [edge_score(drive, with_mount(**{name: way * off})) for off in steps_deg]
    for found, off in zip(scores, steps_deg, strict=True):
        assert found.score is not None
        assert found.score < 0.7
        assert found.better[name] == pytest.approx(-way * off, abs=0.25)
    assert (scores[-1].score or 0.0) < 0.35
    assert (scores[0].score or 0.0) > (scores[-1].score or 0.0) or name == "yaw_deg"


@pytest.mark.parametrize("frames", [slice(5, 17), slice(27, 39)], ids=["057-068", "414-425"])
def test_one_run_of_a_vlp16_is_enough(data_dir: Path, frames: slice):
    uri = f"astyx:{data_dir / 'astyx'}"
    run = looked_at(uri, range(len(open_source(uri)))[frames])
    right, turned = edge_score(run, with_mount()), edge_score(run, with_mount(pitch_deg=2.0))
    assert (right.score, right.better) == (1.0, {})
    assert turned.score is not None
    assert turned.score < 0.4
    assert turned.better == {"pitch_deg": -2.0}


def test_a_rolled_mount_scores_less(drive: list[Seen]):
    found = edge_score(drive, with_mount(roll_deg=4.0))
    assert found.score is not None
    assert found.score < 0.6
    assert found.better["roll_deg"] < 0


@pytest.mark.parametrize("off", [{"yaw_deg": 8.0}, {"yaw_deg": -8.0}, {"pitch_deg": -8.0}], ids=str)
def test_far_from_the_true_mount_nothing_stands_out(drive: list[Seen], off: dict[str, float]):
    found = edge_score(drive, with_mount(**off))
    assert (found.score, found.better) == (None, {})
    assert found.sigmas is not None


def patchwork(like: EdgeScene) -> EdgeScene:
    height, width = like.strength.shape
    patches = np.random.default_rng(0).integers(0, 255, (height // 32 + 1, width // 32 + 1, 3)).astype(np.uint8)
    return scene_of(np.zeros((0, 3)), np.ascontiguousarray(patches.repeat(32, 0).repeat(32, 1)[:height, :width]))


def another_moment(drive: list[Seen]) -> list[Seen]:
    half = len(drive) // 2
    images = [scene for scene, _ in (*drive[half:], *drive[:half])]
    return [
        (EdgeScene(scene.points, image.strength, image.usual), camera)
        for (scene, camera), image in zip(drive, images, strict=True)
    ]


def elsewhere(drive: list[Seen]) -> list[Seen]:
    image = patchwork(drive[0][0])
    return [(EdgeScene(scene.points, image.strength, image.usual), camera) for scene, camera in drive]


@pytest.mark.parametrize("made", [another_moment, elsewhere])
def test_images_of_something_else_have_no_score(drive: list[Seen], made: Callable[[list[Seen]], list[Seen]]):
    """Edges are everywhere, so points lie on edges by chance."""
    found = edge_score(made(drive), with_mount())
    assert found.score is None
    assert found.borders >= FEWEST


# ---------------------------------------------------------------- posts: what no recording is needed for

CAMERA = CameraCalibration(
    K=np.array([[600.0, 0.0, 320.0], [0.0, 600.0, 200.0], [0.0, 0.0, 1.0]]),
    distortion=np.zeros(0),
    T_camera_ego=np.array([[0.0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]]),
    width=640,
    height=400,
)
ANGULAR = {"model": "angular", "h_res_deg": 0.1, "v_res_deg": 0.1, "cx_px": 320.0, "cy_px": 200.0}


def posts(true: AlignmentParams, camera: CameraCalibration | None, frames: int = 4) -> list[Seen]:
    """Bright posts of various heights, 12 m to 25 m ahead, seen by 16 rings and, with the true alignment, by the
    camera."""
    aligned, rng = resolve(true, camera), np.random.default_rng(0)
    assert aligned is not None
    scenes: list[Seen] = []
    for _ in range(frames):
        bgr, points = np.full((400, 640, 3), 60, np.uint8), []
        for azimuth in np.arange(-24.0, 24.0, 3.0) + rng.uniform(-0.8, 0.8, 16):
            range_m, low, high = rng.uniform(12, 25), rng.uniform(-11, 0), rng.uniform(1, 11)
            sides = np.radians([azimuth - 0.5, azimuth + 0.5])
            (u0, v0), (u1, v1) = aligned.project(_at(range_m, sides, np.radians([high, low])))
            bgr[max(0, int(v0)) : max(0, int(v1)), int(min(u0, u1)) : int(max(u0, u1))] = rng.integers(120, 255)
            rings = np.radians([ring for ring in np.arange(-15.0, 16.0, 2.0) if low < ring < high])
            points += [_at(range_m, np.full(len(rings), side), rings) for side in sides]
        scenes.append((scene_of(np.concatenate(points), bgr), camera))
    return scenes


def _at(range_m: float, azimuth: F64, elevation: F64) -> F64:
    return range_m * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])


@pytest.mark.parametrize(
    ("true", "camera", "off", "back"),
    [
        ({}, CAMERA, {"yaw_deg": 2.0}, {"yaw_deg": -2.0}),
        ({}, CAMERA, {"yaw_deg": -1.0, "pitch_deg": 1.5}, {"yaw_deg": 1.0, "pitch_deg": -1.5}),
        ({}, CAMERA, {"roll_deg": -4.0}, {"roll_deg": 4.0}),
        (ANGULAR, None, {"cx_px": 340.0}, {"cx_px": -20.0}),
        (ANGULAR, None, {"cx_px": 310.0, "cy_px": 220.0}, {"cx_px": 10.0, "cy_px": -20.0}),
        (ANGULAR, None, {"h_res_deg": 0.1 / 0.9, "v_res_deg": 0.1 / 0.9}, {"h_res_deg": 0.9, "v_res_deg": 0.9}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_the_way_back_is_told_in_parameters(
    true: dict[str, float | str],
    camera: CameraCalibration | None,
    off: dict[str, float],
    back: dict[str, float],
):
    scenes = posts(with_mount(**true), camera)
    right, wrong = edge_score(scenes, with_mount(**true)), edge_score(scenes, with_mount(**true | off))
    assert (right.score, right.better) == (pytest.approx(1.0, abs=0.1), {})
    assert wrong.score is not None
    assert wrong.score < 0.5
    assert wrong.better == pytest.approx(back, abs=3.0 if camera is None and "cx_px" in back else 0.3)


def test_too_few_borders_say_nothing():
    few = [
        (EdgeScene(scene.points[:5], scene.strength, scene.usual), camera)
        for scene, camera in posts(with_mount(), CAMERA)
    ]
    found = edge_score(few, with_mount())
    assert (found.score, found.sigmas) == (None, None)
    assert 0 < found.borders < FEWEST
    assert edge_score([], with_mount()) == EdgeScore(None, None, 0)


def test_without_a_calibration_nothing_is_aligned():
    scenes: list[Seen] = [(scene, None) for scene, _ in posts(with_mount(), CAMERA)]
    assert edge_score(scenes, with_mount()) == EdgeScore(None, None, 0)
