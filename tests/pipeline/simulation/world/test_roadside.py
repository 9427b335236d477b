"""Roadside objects never stand on a road."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.roadside import Roadside

TOWN = {"lanes_forward": 1, "lanes_oncoming": 1, "median_m": 0.0, "lane_width_m": 3.5}


def built(**road: object) -> tuple[Road, Roadside]:
    made = Road.model_validate({**TOWN, **road})
    return made, Roadside.build(made, 5, 0.0, 900.0)


@pytest.mark.parametrize("angle_deg", [60.0, 90.0])
def test_nothing_stands_on_a_crossing_road(angle_deg: float) -> None:
    crossed, beside = built(segments=[{"length_m": 900}], crossings=[{"s_m": 400.0, "angle_deg": angle_deg}])
    _, without = built(segments=[{"length_m": 900}])
    line = crossed.crossing_lines[0]

    def on_it(roadside: Roadside) -> int:
        x, y, heading = line.to_world(0.0, 0.0)[0]
        across = (roadside.poses[:, 1] - y) * np.cos(heading) - (roadside.poses[:, 0] - x) * np.sin(heading)
        return int(np.count_nonzero(np.abs(across) < crossed.crossings[0].half_width_m() + 1.0))

    assert on_it(beside) == 0
    assert on_it(without) > 0, "the crossing is what makes room"
    assert len(beside.things) > 0.8 * len(without.things)


def test_in_a_winding_road_no_tree_or_house_stands_on_another_stretch_of_it() -> None:
    hairpin = {"length_m": 44, "radius_m": 14}  # the way back runs 28 m beside the way there
    road, beside = built(segments=[{"length_m": 300}, hairpin, {"length_m": 600}])
    course = road.to_world(np.arange(-60.0, 960.0, 1.0), 0.0)[:, :2]
    for thing, pose in zip(beside.things, beside.poses, strict=True):
        if thing.kind in ("tree", "building"):
            nearest = np.hypot(*(course - pose[:2]).T).min()
            assert nearest > 3.5 + min(thing.length_m, thing.width_m) / 2, thing
    assert any(thing.kind == "tree" for thing in beside.things)


def test_a_strip_runs_along_its_bend_without_gaps_as_far_as_it_is_said_to() -> None:
    bend = {"length_m": 200, "radius_m": 40}
    kerb = {"kind": "kerb", "d_m": -5.0, "from_m": 20.0, "to_m": 120.0, "high_m": 0.12}
    _, beside = built(segments=[bend], strips=[kerb])
    pieces = [thing for thing in beside.things if thing.kind == "kerb"]
    assert {thing.d_m for thing in pieces} == {-5.0}
    assert sum(thing.length_m for thing in pieces) >= 100.0 * (40.0 + 5.0) / 40.0
    assert (pieces[0].s_m, pieces[-1].s_m) == pytest.approx((21.0, 119.0))
