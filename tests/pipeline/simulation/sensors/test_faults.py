"""Sensor faults: what each takes, adds or turns, and that a scenario without any is as it was."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation.scenario import load
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.faults import Faults, Knock, disturb_sweep, nods_rad, true_camera
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.types import Sweep


@pytest.fixture(scope="module")
def sweep() -> Sweep:
    scene = load("straight")
    return SensorRig(scene, 600.0).sweep(world_state.at(scene, 0.0), 0, 0)


def test_lost_rings_and_lost_sweeps(sweep: Sweep) -> None:
    left = disturb_sweep(sweep, Faults(lost_rings=(3, 7)), 1, 0)
    assert left is not None
    assert set(np.unique(sweep.ring)) - set(np.unique(left.ring)) == {3, 7}
    assert len(left.points) == len(left.ring) == len(left.time_s)  # type: ignore[arg-type]
    lost = [disturb_sweep(sweep, Faults(sweeps_lost=0.3), 1, index) is None for index in range(300)]
    assert np.mean(lost) == pytest.approx(0.3, abs=0.08)


def test_clouds_come_on_top_and_are_small(sweep: Sweep) -> None:
    added = [disturb_sweep(sweep, Faults(spurious_clusters=0.5), 1, index) for index in range(100)]
    more = [len(each.points) - len(sweep.points) for each in added if each is not None]
    assert min(more) == 0
    assert 0 < max(more) < 60
    assert all(np.array_equal(each.points[: len(sweep.points)], sweep.points) for each in added if each is not None)


def test_a_nod_lifts_what_is_ahead_in_both_sensors_alike(sweep: Sweep) -> None:
    """With the nose 1° down, everything at 30 m appears 0.52 m higher, and by the same amount in the image."""
    nod = float(np.radians(1.0))
    tilted = disturb_sweep(sweep, Faults(nods_deg=1.0), 1, 0, nod)
    assert tilted is not None
    lifted = tilted.points[:, 2] - sweep.points[:, 2]
    assert lifted == pytest.approx(np.tan(nod) * sweep.points[:, 0], abs=1e-4)
    level, nodding = calibration(), true_camera(calibration(), Faults(), nod)
    ahead = np.array([30.0, 0.0, 0.3, 1.0])
    higher = np.array([30.0, 0.0, 0.3 + 30.0 * np.tan(nod), 1.0])
    seen, wanted = nodding.T_camera_ego @ ahead, level.T_camera_ego @ higher
    assert seen[1] / seen[2] == pytest.approx(wanted[1] / wanted[2], abs=2e-3)


def test_a_camera_that_looks_left_sees_things_farther_to_the_right() -> None:
    turned = true_camera(calibration(), Faults(camera_yaw_deg=0.5))
    before, after = (each.T_camera_ego @ np.array([40.0, 0.0, 0.0, 1.0]) for each in (calibration(), turned))
    assert np.degrees(np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])) == pytest.approx(0.5, abs=0.01)


def test_a_knock_turns_the_camera_from_then_on() -> None:
    faults = Faults(camera_yaw_deg=0.5, knock=Knock(at_s=2.0, yaw_deg=1.0))
    for t_s, yaw_deg in ((1.9, 0.5), (2.0, 1.5)):
        seen, wanted = (
            true_camera(calibration(), each, 0.0, t_s).T_camera_ego for each in (faults, Faults(camera_yaw_deg=yaw_deg))
        )
        assert seen == pytest.approx(wanted)


def test_nods_have_the_size_that_is_asked_for() -> None:
    nods = np.degrees(nods_rad(Faults(nods_deg=0.3), 1, 5000, 10.0))
    assert nods.std() == pytest.approx(0.3, rel=0.1)
