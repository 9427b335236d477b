"""Pairs picked by hand: a known mount comes back, a wrong pair does no harm, and what is missing is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import Alignment, Angular, resolve
from pipeline.calibration.alignment.models import ModelName
from pipeline.calibration.alignment.point_pair_doubts import PairsRefused
from pipeline.calibration.alignment.point_pairs import (
    CLUSTER_M,
    PICK_DEG,
    PointPair,
    PointPairFit,
    fit_point_pairs,
)
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE

TRUE = {"yaw_deg": 2.5, "pitch_deg": -1.5, "roll_deg": 1.0}
MOVED = {**TRUE, "left_m": 0.15, "up_m": -0.1}
ANGULAR = Angular(np.radians(0.072), np.radians(0.069), 655.0, 170.0)
NOISE_PX = np.tan(np.radians(PICK_DEG)) * 800.0


def places(count: int, seed: int = 0, bearing_deg: float = 30.0) -> np.ndarray:
    """(N, 3) places ahead, 6 to 40 m away."""
    rng = np.random.default_rng(seed)
    range_m, bearing = rng.uniform(6.0, 40.0, count), np.radians(rng.uniform(-bearing_deg, bearing_deg, count))
    up = range_m * np.tan(np.radians(rng.uniform(-7.0, 4.0, count)))
    return np.column_stack([range_m * np.cos(bearing), range_m * np.sin(bearing), up])


def picked(true: Alignment, points: np.ndarray, noise_px: float = 0.0, seed: int = 0) -> list[PointPair]:
    pixels = true.project(points) + np.random.default_rng(seed).normal(0.0, 1.0, (len(points), 2)) * noise_px
    return [PointPair(point, pixel) for point, pixel in zip(points, pixels, strict=True)]


def moved(pair: PointPair, *by_px: float) -> PointPair:
    return replace(pair, pixel=pair.pixel + np.array(by_px))


def pinhole(**values: float) -> Alignment:
    found = resolve(AlignmentParams(**values), CAMERA)
    assert found is not None
    return found


def fit(
    pairs: list[PointPair], name: ModelName = "pinhole", offset: bool = False, present: AlignmentParams | None = None
) -> PointPairFit:
    camera = CAMERA if name == "pinhole" else None
    return fit_point_pairs(pairs, name, present or AlignmentParams(), camera, SIZE, offset)


def test_exact_pairs_give_the_mount_back():
    found = fit(picked(pinhole(**TRUE), places(3)))
    assert found.values == pytest.approx(TRUE, abs=2e-3)
    assert found.rms_px < 0.01
    assert not found.outliers
    assert not found.warnings
    assert found.changes == {"alignment.model": "pinhole", **{f"alignment.{k}": v for k, v in found.values.items()}}


def test_exact_pairs_give_the_mount_and_its_place_back():
    found = fit(picked(pinhole(**MOVED), places(6)), offset=True)
    assert found.values == pytest.approx(MOVED, abs=2e-3)


def test_exact_pairs_give_the_angular_model_back_without_a_calibration():
    found = fit(picked(ANGULAR, places(4)), "angular")
    assert found.values["h_res_deg"] == pytest.approx(0.072, abs=1e-5)
    assert found.values["v_res_deg"] == pytest.approx(0.069, abs=1e-5)
    assert (found.values["cx_px"], found.values["cy_px"]) == pytest.approx((655.0, 170.0), abs=0.1)


def test_a_place_that_is_set_is_kept():
    place = {"forward_m": 0.2, "left_m": 0.1}
    found = fit(picked(pinhole(**TRUE, **place), places(4)), present=AlignmentParams(**place))
    assert found.values == pytest.approx(TRUE, abs=2e-3)
    assert found.changes["alignment.forward_m"] == 0.2


def test_a_lens_with_distortion_is_heeded():
    bent = replace(CAMERA, distortion=np.array([-0.3, 0.1, 0.0, 0.0]))
    true = resolve(AlignmentParams(**TRUE), bent)
    assert true is not None
    found = fit_point_pairs(picked(true, places(4)), "pinhole", AlignmentParams(), bent, SIZE)
    assert found.values == pytest.approx(TRUE, abs=2e-3)


@pytest.mark.parametrize(
    ("name", "offset", "truth"),
    [("pinhole", False, TRUE), ("pinhole", True, MOVED), ("angular", False, {"h_res_deg": 0.072, "v_res_deg": 0.069})],
)
def test_deviations_from_noisy_pairs_are_as_reported(name: ModelName, offset: bool, truth: dict[str, float]):
    true = ANGULAR if name == "angular" else pinhole(**truth)
    ratios = []
    for seed in range(12):
        found = fit(picked(true, places(8, seed), NOISE_PX, seed), name, offset)
        ratios.append([(found.values[each] - truth[each]) / found.sigmas[each] for each in truth])
        assert not found.outliers
    size = float(np.sqrt(np.mean(np.square(ratios))))
    assert 0.7 < size < 1.3, "errors are one standard deviation in the mean"
    assert (
        fit(picked(true, places(40), NOISE_PX), name, offset).sigmas[next(iter(truth))]
        < found.sigmas[next(iter(truth))]
    )


@pytest.mark.parametrize(("name", "offset"), [("pinhole", False), ("pinhole", True), ("angular", False)])
@pytest.mark.parametrize("wrong", [0, 4])
def test_a_wrong_pair_is_named_and_does_no_harm(name: ModelName, offset: bool, wrong: int):
    true = ANGULAR if name == "angular" else pinhole(**(MOVED if offset else TRUE))
    pairs = picked(true, places(6), NOISE_PX / 2)
    without = fit(pairs[:wrong] + pairs[wrong + 1 :], name, offset)
    pairs[wrong] = moved(pairs[wrong], 60.0, -25.0)
    found = fit(pairs, name, offset)
    assert found.outliers == (wrong,)
    assert f"pair {wrong + 1} contradicts the others by" in found.warnings[0]
    assert found.values == pytest.approx(without.values, rel=1e-3, abs=2e-3)
    assert found.rms_px == pytest.approx(without.rms_px, rel=1e-2)


def test_of_few_pairs_none_is_left_out_but_their_contradiction_is_told():
    pairs = picked(pinhole(**TRUE), places(3))
    pairs[1] = moved(pairs[1], 60.0, 40.0)
    found = fit(pairs)
    assert not found.outliers
    assert "the pairs contradict each other, pair 2" in found.warnings[0]
    assert found.sigmas["yaw_deg"] > 3.0 * fit(picked(pinhole(**TRUE), places(3))).sigmas["yaw_deg"]


def test_a_hand_that_is_less_steady_than_expected_has_no_outliers_but_larger_deviations():
    steady, shaky = (fit(picked(pinhole(**TRUE), places(10), NOISE_PX * k)) for k in (1.0, 4.0))
    assert not shaky.outliers
    assert shaky.sigmas["yaw_deg"] > 2.0 * steady.sigmas["yaw_deg"]


def test_a_cluster_counts_less_than_a_point():
    points = places(5, bearing_deg=20.0)
    pairs = picked(pinhole(**TRUE), points)
    off = [moved(each, 8.0, 0.0) for each in pairs[:2]]
    alike = fit([*off, *pairs[2:]])
    less = fit([*(replace(each, sigma_m=CLUSTER_M * 4) for each in off), *pairs[2:]])
    assert abs(less.values["yaw_deg"] - TRUE["yaw_deg"]) < 0.5 * abs(alike.values["yaw_deg"] - TRUE["yaw_deg"])


def test_two_pairs_fit_but_nothing_checks_them():
    assert fit(picked(pinhole(**TRUE), places(3)[1:])).warnings == ("no pair checks the others: add one",)


AHEAD = np.array([[20.0, 0.1, 0.0], [25.0, 0.0, 0.1], [30.0, -0.1, 0.3], [18.0, 0.0, -0.1]])
ONE_ROW = np.array([[10.0, y, 0.0] for y in (-4.0, -1.0, 2.0, 5.0)])
ONE_COLUMN = np.array([[10.0, 0.0, z] for z in (-1.2, -0.5, 0.4, 1.0)])
ONE_RANGE = places(6) / np.linalg.norm(places(6), axis=1)[:, None] * 25.0


@pytest.mark.parametrize(
    ("name", "offset", "points", "missing"),
    [
        ("pinhole", False, places(0), "2 pairs are needed; 2 more"),
        ("pinhole", False, places(1), "2 pairs are needed; 1 more"),
        ("pinhole", True, places(2), "3 pairs are needed, with the position; 1 more"),
        ("angular", False, places(1), "2 pairs are needed; 1 more"),
        ("pinhole", False, AHEAD, "do not determine the roll: add one far from the others"),
        ("pinhole", False, np.repeat(places(1), 3, axis=0), "do not determine the roll"),
        ("pinhole", True, ONE_RANGE, "much nearer or farther"),
        ("angular", False, ONE_ROW, "do not determine v_res: add one higher or lower"),
        ("angular", False, ONE_COLUMN, "do not determine h_res: add one farther to the left or right"),
        ("angular", False, np.repeat(places(1), 3, axis=0), "do not determine"),
    ],
)
def test_pairs_that_do_not_determine_it_are_refused_with_what_is_missing(
    name: ModelName, offset: bool, points: np.ndarray, missing: str
):
    true = ANGULAR if name == "angular" else pinhole(**TRUE)
    with pytest.raises(PairsRefused, match=missing):
        fit(picked(true, points), name, offset)


def test_pairs_beyond_what_can_be_set_are_refused():
    far = [moved(each, 220.0, 0.0) for each in picked(pinhole(**TRUE), places(4))]
    with pytest.raises(PairsRefused, match="more yaw than can be set"):
        fit(far)


def test_a_pinhole_needs_a_calibration():
    with pytest.raises(PairsRefused, match="choose the angular model"):
        fit_point_pairs(picked(pinhole(**TRUE), places(4)), "pinhole", AlignmentParams(), None, SIZE)


def test_a_point_behind_the_camera_is_named():
    pairs = picked(pinhole(**TRUE), places(5))
    found = fit([*pairs, PointPair(np.array([-10.0, 1.0, 0.0]), np.array([600.0, 200.0]))])
    assert found.warnings == ("pair 6 is not in front of the camera and is left out: remove it",)
    assert found.values == pytest.approx(TRUE, abs=2e-3)
