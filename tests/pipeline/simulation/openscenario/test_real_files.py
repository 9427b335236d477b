"""Euro NCAP's scenarios as published by Vector: every file opens or is refused for a known reason, and what opens is
the test that the protocol describes."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from pipeline.simulation import scenario
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.sources import open_source

KMH = 1 / 3.6
GVT_LENGTH_M, GVT_NOSE_M = 4.023, 1.328 + 4.023 / 2
EGO_NOSE_M = 1.349 + 4.358 / 2
"""Front of the vehicle ahead of its reference point, from the catalog's bounding boxes."""
REASONS = {
    "pedestrian": r"is a Pedestrian, which is not supported",
    "bicycle": r"is a bicycle, which is not supported",
    "route": r"FollowTrajectoryAction is not supported as the start of the ego vehicle",
    "trajectory": r"FollowTrajectoryAction needs a Trajectory; catalogs of trajectories are not read",
    "variants": r"\d+ variants of .*; choose one with .*\?variant=1",
    "catalog": r"no Storyboard: it is not a scenario",
}
EXPECTED = [
    (r"/Catalogs/", "catalog"),
    (r"/(NCAP_AEB_VRU_)?(CB(FA|NA|NAO)|CBLA(_FCW)?)\b", "bicycle"),
    (r"NCAP_AEB_VRU_CB\w+(-\d+)?_\w*2023|NCAP_AEB_VRU_CB", "bicycle"),
    (r"/CBLA|/CB(FA|NA|NAO)_", "bicycle"),
    (r"(VRU_|/)CP", "pedestrian"),
    (r"CCFhol", "trajectory"),
    (r"C[CM]Ftap|C[CM]Cscp", "route"),
    (r"Variation_2023|/(Standard|Extended)Range/", "variants"),
]
"""Part of the path → reason, the first that matches; everything else opens."""


@pytest.fixture(scope="module")
def folder(data_dir: Path) -> Path:
    found = data_dir / "openscenario" / "OSC-NCAP-scenarios" / "OpenSCENARIO" / "NCAP"
    if not found.is_dir():
        pytest.skip(f"no OpenSCENARIO files at {found}")
    return found


@cache
def load(path: str) -> Scenario:
    return scenario.load(path)


def refusal(path: Path) -> str | None:
    """Why it does not open, in one line; None if it does."""
    try:
        made = load(str(path))
    except ScenarioError as error:
        return next((name for name, text in REASONS.items() if re.search(f"^.*{text}.*$", str(error))), str(error))
    for t_s in (0.0, made.duration_s / 2, made.duration_s):
        world_state.at(made, t_s)
    return None


def test_every_file_opens_or_is_refused_for_its_reason(folder: Path) -> None:
    files = sorted(folder.rglob("*.xosc"))
    assert len(files) > 100
    expected = {
        path: next((reason for part, reason in EXPECTED if re.search(part, path.as_posix())), None) for path in files
    }
    assert {path.name: refusal(path) for path in files if refusal(path) != expected[path]} == {}
    assert sum(reason is None for reason in expected.values()) == 14


@pytest.mark.parametrize("name", ["CCRb", "CCRm", "CCRs", "CMRb", "CMRs", "CCFhos"])
@pytest.mark.parametrize("grid", ["StandardRange", "ExtendedRange"])
def test_every_variant_of_a_grid_opens(grid: str, name: str, folder: Path) -> None:
    path = folder / "CA-FC_2026" / "Variations" / grid / f"{name}.xosc"
    with pytest.raises(ScenarioError) as error:
        load(str(path))
    count = int(re.findall(r": (\d+) variants", str(error.value))[0])
    drives = [load(f"{path}?variant={number}") for number in range(1, count + 1)]
    assert len({(drive.ego.speed_mps[0.0], drive.actors[0].offset_m, drive.actors[0].ahead_m) for drive in drives}) > 5
    assert all(2.0 < drive.duration_s < 60.0 for drive in drives)


def ahead_m(made: Scenario, t_s: float) -> float:
    """From the ego nose to the target's rear."""
    (state,) = world_state.at(made, t_s).actors
    return float(state.cuboid.center[0] - state.cuboid.size[0] / 2)


SINGLE = "CA-FC_2026/Variations/SingleExecution"


@pytest.mark.parametrize(
    ("file", "ego_kmh", "target_kmh"),
    [
        (f"{SINGLE}/CCRs_50kph.xosc", 50.0, 0.0),
        (f"{SINGLE}/CCRm_50kph.xosc", 50.0, 20.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRs_50kph_2023.xosc", 50.0, 0.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRm_50kph_2023.xosc", 50.0, 20.0),
    ],
)
def test_an_approach_at_constant_speed(file: str, ego_kmh: float, target_kmh: float, folder: Path) -> None:
    """The reference points are 5 s of the ego speed apart; the drive ends 1 s after the faces meet."""
    made = load(str(folder / file))
    gap_m = 5.0 * ego_kmh * KMH - EGO_NOSE_M - (GVT_LENGTH_M - GVT_NOSE_M)
    assert made.ego.speed_mps == pytest.approx({0.0: ego_kmh * KMH})
    assert made.actors[0].speed_mps == pytest.approx({0.0: target_kmh * KMH})
    assert ahead_m(made, 0.0) == pytest.approx(gap_m, abs=1e-6)
    assert made.duration_s == pytest.approx(gap_m / ((ego_kmh - target_kmh) * KMH) + 1.0, abs=0.041)
    assert made.actors[0].offset_m == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("file", "options", "gap_m", "decel_mps2"),
    [
        (f"{SINGLE}/CCRb_50kph.xosc", "", 50 * KMH * 1.0, 4.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRb_40m_2ms2_2023.xosc", "", 40.0, 2.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRb_Variation_2023.xosc", "?variant=1", 12.0, 2.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRb_Variation_2023.xosc", "?variant=4", 40.0, 6.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRb_Variation_2023.xosc", "?GVT_headway=25&variant=2", 25.0, 6.0),
    ],
)
def test_a_target_that_brakes(file: str, options: str, gap_m: float, decel_mps2: float, folder: Path) -> None:
    """Both at 50 km/h, the demanded gap between the faces, braking after 3 s down to 2 km/h."""
    made = load(f"{folder / file}{options}")
    (actor,) = made.actors
    assert ahead_m(made, 0.0) == pytest.approx(gap_m)
    assert ahead_m(made, 3.0) == pytest.approx(gap_m)
    speeds = [actor.speed_and_accel(t_s) for t_s in (2.9, 3.5, 20.0)]
    assert [speed for speed, _ in speeds] == pytest.approx([50 * KMH, 50 * KMH - 0.5 * decel_mps2, 2 * KMH])
    assert [accel for _, accel in speeds] == pytest.approx([0.0, -decel_mps2, 0.0])


def test_an_offset_follows_from_the_impact_location(folder: Path) -> None:
    """25 % of the ego vehicle's width: its reference point is a quarter of 1.815 m to the right of the middle."""
    assert load(str(folder / SINGLE / "CMRb_50kph.xosc")).actors[0].offset_m == pytest.approx(-0.25 * 1.815, abs=1e-6)


def test_a_head_on_target_comes_on_the_ego_lane(folder: Path) -> None:
    made = load(str(folder / SINGLE / "CCFhos_50kph_50kph.xosc"))
    (state,) = world_state.at(made, 4.0).actors
    assert state.cuboid.center[1] == pytest.approx(0.0)
    assert ahead_m(made, 0.0) - ahead_m(made, 4.0) == pytest.approx(4.0 * 100 * KMH)


def test_the_first_frames_have_the_target_in_sweep_and_truth(folder: Path) -> None:
    source = open_source(str(folder / SINGLE / "CCRb_50kph.xosc"))
    for index in range(3):
        frame, (truth,) = source.frame(index), source.truth(index)
        assert frame.image is not None
        assert frame.sweep is not None
        points = frame.sweep.points[:, :3]
        near = abs(points - truth.cuboid.center) < [GVT_LENGTH_M / 2 + 0.2, 1.0, 0.9]
        assert near.all(axis=1).sum() > 20
