"""Euro NCAP's scenarios as published by Vector: every file opens or is refused for a known reason, and what opens is
the test that the protocol describes."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from math import degrees
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.simulation import scenario
from pipeline.simulation.openscenario.roads.free_line import overlaps
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.sources import open_source

KMH = 1 / 3.6
GVT_LENGTH_M, GVT_NOSE_M = 4.023, 1.328 + 4.023 / 2
EGO_NOSE_M = 1.349 + 4.358 / 2
"""Front of the vehicle ahead of its reference point, from the catalog's bounding boxes."""
REASONS = {
    "backwards": r"the trajectory of Ego leads behind it, and driving backwards is not supported",
    "variants": r"\d+ variants of .*; choose one with .*\?variant=1",
    "catalog": r"no Storyboard: it is not a scenario",
}
EXPECTED = [
    (r"/Catalogs/", "catalog"),
    (r"CPRA_C[ms]", "backwards"),
    (r"CPTAf[os]-50_Variation_2023|Variation_2023|/(Standard|Extended)Range/", "variants"),
]
"""Part of the path → reason, the first that matches; everything else opens."""
OPEN = {
    "AEB_C2C_2023": 4,
    "AEB_C2C_2023/Variations": 6,
    "AEB_VRU_2023": 7,
    "AEB_VRU_2023/Variations": 16,
    "CA-FC_2026": 10,
    "CA-FC_2026/Variations/SingleExecution": 18,
}
"""Number of files that open as they are, by folder."""
MOTIONS = {
    "AEB_C2C_2023/NCAP_AEB_C2C_CCFhos_2023.xosc": (8.84, 306.25, 134.37, -37.52, 0.00),
    "AEB_C2C_2023/NCAP_AEB_C2C_CCR_2023.xosc": (5.26, 25.58, 10.97, -3.64, 0.00),
    "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCFhos_50kph_2023.xosc": (8.76, 217.37, 95.70, -25.97, 0.00),
    "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRb_40m_2ms2_2023.xosc": (10.34, 42.01, 37.30, -11.41, 0.00),
    "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRm_50kph_2023.xosc": (8.84, 67.24, 30.41, -6.42, 0.00),
    "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRs_50kph_2023.xosc": (5.70, 67.24, 27.66, -11.92, 0.00),
    "CA-FC_2026/CCFhos.xosc": (8.76, 217.37, 95.70, -25.97, 0.00),
    "CA-FC_2026/CCRs.xosc": (5.26, 25.58, 10.97, -3.64, 0.00),
    "CA-FC_2026/Variations/SingleExecution/CCFhos_50kph_50kph.xosc": (8.76, 217.37, 95.70, -25.97, 0.00),
    "CA-FC_2026/Variations/SingleExecution/CCRb_50kph.xosc": (6.64, 15.90, 15.70, -10.41, 0.00),
    "CA-FC_2026/Variations/SingleExecution/CCRm_50kph.xosc": (8.84, 67.24, 30.41, -6.42, 0.00),
    "CA-FC_2026/Variations/SingleExecution/CCRs_50kph.xosc": (5.70, 67.24, 27.66, -11.92, 0.00),
    "CA-FC_2026/Variations/SingleExecution/CMRb_50kph.xosc": (6.64, 14.93, 14.72, -11.38, -0.45),
    "CA-FC_2026/Variations/SingleExecution/CMRs_50kph.xosc": (5.72, 66.59, 26.87, -12.86, 0.00),
}
"""Targets along the ego vehicle's lane: duration; ego x of the target's centre at the start, half time and end; y."""


SINGLE = "CA-FC_2026/Variations/SingleExecution"


@pytest.fixture(scope="module")
def folder(data_dir: Path) -> Path:
    found = data_dir / "openscenario" / "OSC-NCAP-scenarios" / "OpenSCENARIO" / "NCAP"
    if not found.is_dir():
        pytest.skip(f"no OpenSCENARIO files at {found}")
    return found


@cache
def outcome(path: str) -> Scenario | ScenarioError:
    """The scenario, or why it does not open; many tests ask for the same ones."""
    try:
        return scenario.load(path)
    except ScenarioError as error:
        return error


def load(path: str) -> Scenario:
    made = outcome(path)
    if isinstance(made, ScenarioError):
        raise made.with_traceback(None)
    return made


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
    opened = Counter(path.parent.relative_to(folder).as_posix() for path in files if expected[path] is None)
    assert opened == OPEN


@pytest.mark.parametrize("file", MOTIONS)
def test_targets_along_the_lane_move_as_they_always_did(file: str, folder: Path) -> None:
    made = load(str(folder / file))
    states = [world_state.at(made, share * made.duration_s).actors[0] for share in (0.0, 0.5, 1.0)]
    ahead = [state.cuboid.center[0] for state in states]
    assert (made.duration_s, *ahead, states[-1].cuboid.center[1]) == pytest.approx(MOTIONS[file], abs=0.006)
    assert made.free_actors == ()


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


@pytest.mark.parametrize("grid", ["CA-FC_2026/Variations/StandardRange", "CA-FC_2026/Variations/ExtendedRange"])
@pytest.mark.parametrize(
    "name",
    ["CBFA", "CBLA", "CBNA", "CBNAO", "CCCscp", "CCFtap", "CMCscp", "CMFtap", "CPFA", "CPLA", "CPNA", "CPNCO"],
)
def test_the_first_and_last_variant_of_a_crossing_grid_open(grid: str, name: str, folder: Path) -> None:
    path = folder / grid / f"{name}.xosc"
    with pytest.raises(ScenarioError) as error:
        load(str(path))
    count = int(re.findall(r": (\d+) variants", str(error.value))[0])
    drives = [load(f"{path}?variant={number}") for number in (1, count)]
    assert drives[0].ego.speed_mps != drives[1].ego.speed_mps or drives[0].free_actors != drives[1].free_actors


def contact(made: Scenario) -> tuple[str, float, float, float]:
    """What the ego vehicle, 4.358 m by 1.815 m, touches first if nobody brakes: kind, ego y, yaw in degrees, km/h."""
    own = Cuboid((-4.358 / 2, 0.0, 0.0), (4.358, 1.815, 1.5), 0.0).footprint()
    for t_s in np.arange(0.0, made.duration_s, 0.02).tolist():
        for state in world_state.at(made, t_s).actors:
            if overlaps(own, state.cuboid.footprint()):
                yaw = degrees(state.cuboid.yaw_rad)
                return state.actor.kind, state.cuboid.center[1], yaw, state.speed_mps / KMH
    pytest.fail("they do not meet")


VRU = "AEB_VRU_2023/Variations/NCAP_AEB_VRU_"


@pytest.mark.parametrize(
    ("file", "kind", "y", "yaw_deg", "kmh"),
    [
        (f"{SINGLE}/CPNA_25_50kph.xosc", "pedestrian", -0.45, 90.0, 5.0),
        (f"{VRU}CPNA-75_50kph_2023.xosc", "pedestrian", 0.45, 90.0, 5.0),
        (f"{SINGLE}/CPFA_50_50kph.xosc", "pedestrian", 0.0, -90.0, 8.0),
        (f"{SINGLE}/CPNCO_50_50kph.xosc", "pedestrian", 0.0, 90.0, 5.0),
        (f"{SINGLE}/CPLA_50_50kph.xosc", "pedestrian", 0.0, 0.0, 5.0),
        (f"{SINGLE}/CBNA_50_50kph.xosc", "bicycle", 0.0, 90.0, 15.0),
        (f"{SINGLE}/CBNAO_50_50kph.xosc", "bicycle", 0.0, 90.0, 10.0),
        (f"{SINGLE}/CBFA_50_50kph.xosc", "bicycle", 0.0, -90.0, 20.0),
        (f"{VRU}CBLA-25_50kph_2023.xosc", "bicycle", -0.45, 0.0, 20.0),
        (f"{VRU}CPTAfo-50_10kph_2023.xosc", "pedestrian", 0.0, 90.0, 5.0),
        (f"{VRU}CPTAns-50_10kph_2023.xosc", "pedestrian", 0.0, 90.0, 5.0),
        (f"{SINGLE}/CCCscp_20kph_20kph_FS.xosc", "car", 1.0, -90.0, 20.0),
        (f"{SINGLE}/CMCscp_20kph_20kph_FS.xosc", "motorcycle", 1.95, -90.0, 20.0),
        (f"{SINGLE}/CCFtap_10kph_30kph.xosc", "car", -0.91, 135.0, 30.0),
        (f"{SINGLE}/CMFtap_10kph_30kph.xosc", "motorcycle", -1.0, 135.0, 30.0),
        ("AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCFhol_50kph_2023.xosc", "car", 0.0, 180.0, 50.0),
    ],
)
def test_who_crosses_is_hit_where_and_how_the_protocol_says(
    file: str, kind: str, y: float, yaw_deg: float, kmh: float, folder: Path
) -> None:
    """Impact at 25, 50 or 75 % of the width of 1.815 m, the centre of pedestrians up to 6 cm beside it. The turning ego
    vehicle meets oncoming traffic at 45°. Its nose follows the trajectory, in reality its rear
    axle, so it meets pedestrians at the end of its turn half a metre beside the intended point."""
    found = contact(load(str(folder / file)))
    assert found[0] == kind
    assert found[1] == pytest.approx(y, abs=0.55 if "CPTA" in file else 0.12)
    assert abs((found[2] - yaw_deg + 180.0) % 360.0 - 180.0) < 9.0
    assert found[3] == pytest.approx(kmh, abs=0.1)


def ahead_m(made: Scenario, t_s: float) -> float:
    """From the ego nose to the target's rear."""
    (state,) = world_state.at(made, t_s).actors
    return float(state.cuboid.center[0] - state.cuboid.size[0] / 2)


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
