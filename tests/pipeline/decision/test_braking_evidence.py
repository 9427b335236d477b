"""How hard an object may make the car brake, by what is known of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.decision.braking_evidence import judge
from pipeline.params import ExistenceParams
from pipeline.types import Braking, FusedObject
from tests.pipeline.build import fused

PARAMS = ExistenceParams()
CAMERA = replace(fused(1, 30.0, source="V"), existence=0.95, in_path_probability=0.95)
RANGED = replace(CAMERA, camera_ranges=8, height_from="range", velocity_mps=(-24.0, 0.0), camera_speed_sigma_mps=2.5)
"""The camera has tracked it for a long time, and single LiDAR returns have ranged it."""
BOTH = replace(fused(1, 30.0), existence=0.95, ranged_hits=5)


@pytest.mark.parametrize(
    ("item", "hardest"),
    [
        pytest.param(replace(CAMERA, camera_ranges=3), Braking.COMFORT, id="the camera alone, for a moment"),
        pytest.param(replace(CAMERA, camera_ranges=8), Braking.PARTIAL, id="the camera alone, for long"),
        pytest.param(replace(CAMERA, camera_ranges=99, existence=0.6), Braking.COMFORT, id="for long, but doubtful"),
        pytest.param(
            replace(CAMERA, camera_ranges=99, in_path_probability=0.51),
            Braking.COMFORT,
            id="for long, but hardly in the path: an oncoming car before a bend",
        ),
        pytest.param(RANGED, Braking.FULL, id="the camera for long, and LiDAR ranges"),
        pytest.param(replace(RANGED, camera_ranges=7), Braking.COMFORT, id="LiDAR ranges, the camera not for long"),
        pytest.param(replace(RANGED, height_from="road"), Braking.PARTIAL, id="for long, its height never measured"),
        pytest.param(replace(RANGED, camera_speed_sigma_mps=4.0), Braking.PARTIAL, id="ranged, its speed uncertain"),
        pytest.param(replace(RANGED, velocity_mps=(-6.0, 0.0)), Braking.PARTIAL, id="ranged, slowly approached"),
        pytest.param(replace(RANGED, in_path_probability=0.6), Braking.COMFORT, id="ranged, perhaps beside the path"),
        pytest.param(replace(BOTH, ranged_hits=1), Braking.PARTIAL, id="the LiDAR, once"),
        pytest.param(replace(BOTH, ranged_hits=3), Braking.FULL, id="the LiDAR, three times"),
        pytest.param(replace(BOTH, ranged_hits=1, camera_ranges=8), Braking.PARTIAL, id="for long, now measured"),
        pytest.param(replace(BOTH, existence=0.5), Braking.COMFORT, id="measured, but doubtful"),
        pytest.param(
            replace(BOTH, in_path_probability=0.2), Braking.FULL, id="measured beside the path: it may be crossing"
        ),
    ],
)
def test_what_it_justifies(item: FusedObject, hardest: Braking) -> None:
    (found,) = judge((item,), PARAMS)
    assert found.justifies is hardest


def test_switched_off_only_a_box_height_is_not_enough_for_full_braking() -> None:
    off = ExistenceParams(enabled=False)
    assert [each.justifies for each in judge((CAMERA, replace(BOTH, ranged_hits=1)), off)] == [
        Braking.PARTIAL,
        Braking.FULL,
    ]
