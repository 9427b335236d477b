"""The built-in scenarios, told in words and held to them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.simulation import built_in, scenario
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import F64

NAMES = built_in.names()
EGO = Cuboid((-2.3, 0.0, 0.0), (4.6, 1.9, 1.5), 0.0)


@cache
def drive(name: str) -> tuple[World, ...]:
    built_in = scenario.load(name)
    return tuple(world_state.at(built_in, i / 5) for i in range(round(built_in.duration_s * 5)))


def actor(now: World, number: int) -> ActorState:
    return next(state for state in now.actors if state.actor.id == number)


def gap_m(now: World, number: int) -> float:
    """Distance along x from the bumper to an actor's nearest corner."""
    return float(actor(now, number).cuboid.footprint()[:, 0].min())


def apart(a: F64, b: F64) -> bool:
    """Whether a side of one of two rectangles separates them (separating axis theorem)."""
    for one, other in ((a, b), (b, a)):
        for edge in np.roll(one, -1, axis=0) - one:
            normal = np.array([-edge[1], edge[0]])
            if (one @ normal).max() < (other @ normal).min() or (other @ normal).max() < (one @ normal).min():
                return True
    return False


def test_there_are_the_papers_four_and_more() -> None:
    assert {"straight", "left_turn", "turn_across_left", "turn_across_right"} <= set(NAMES)
    assert {"curve_250", "s_curve", "cut_in", "cut_out", "ccrs_100", "ccrm_50_20", "ccrb_50", "stop_and_go"} <= set(
        NAMES
    )


@pytest.mark.parametrize("name", NAMES)
def test_nobody_drives_into_anybody(name: str) -> None:
    for now in drive(name):
        bodies = [(0, EGO.footprint()), *((s.actor.id, s.cuboid.footprint()) for s in now.actors)]
        for i, (number, body) in enumerate(bodies):
            for other, other_body in bodies[i + 1 :]:
                assert apart(body, other_body), f"{number} and {other} at {now.t_s} s"


@pytest.mark.parametrize("name", NAMES)
def test_the_ego_car_can_drive_so(name: str) -> None:
    """At most 8 m/s² longitudinally and 5 m/s² laterally."""
    speeds = np.array([now.speed_mps for now in drive(name)])
    assert np.abs(np.diff(speeds) * 5).max() < 8.0
    assert max(abs(now.speed_mps * now.yaw_rate_radps) for now in drive(name)) < 5.0


@pytest.mark.parametrize(
    ("name", "number", "first_m", "last_m", "ends_at_mps"),
    [
        ("ccrs_100", 1, 150.0, 10.0, 0.0),
        ("ccrm_50_20", 1, 100.0, 20.0, 5.56),
        ("ccrb_50", 1, 50.0, 12.0, 0.0),
    ],
)
def test_braking_manoeuvres_end_as_they_say(
    name: str, number: int, first_m: float, last_m: float, ends_at_mps: float
) -> None:
    first, last = drive(name)[0], drive(name)[-1]
    assert gap_m(first, number) == pytest.approx(first_m)
    assert gap_m(last, number) == pytest.approx(last_m, abs=0.7)
    assert last.speed_mps == pytest.approx(ends_at_mps)


@pytest.mark.parametrize(("name", "sign"), [("turn_across_left", -1.0), ("turn_across_right", 1.0)])
def test_a_car_crosses_the_path_close_ahead(name: str, sign: float) -> None:
    """From left to right in one, from right to left in the other, 8 to 30 m before the ego car."""
    states = [(now, actor(now, 1).cuboid) for now in drive(name)]
    y = np.array([cuboid.center[1] for _, cuboid in states])
    crossing = np.flatnonzero(np.diff(np.sign(y)) != 0)
    assert len(crossing) == 1
    assert np.sign(y[crossing[0] + 1]) == sign
    assert 8.0 < states[crossing[0]][1].center[0] < 30.0


def test_in_the_left_turn_the_lead_leaves_the_straight_line_and_stays_in_the_lane() -> None:
    beside = [abs(actor(now, 1).cuboid.center[1]) for now in drive("left_turn")]
    assert max(beside) > 5.0
    ahead = [gap_m(now, 1) for now in drive("left_turn")]
    assert 15.0 < min(ahead) < 30.0
    turned = drive("left_turn")[-1].pose[2] - drive("left_turn")[0].pose[2]
    assert np.degrees(turned) == pytest.approx(90.0, abs=1.5)


def test_in_the_bend_another_lane_lies_straight_ahead() -> None:
    """A vehicle outside the ego lane crosses the straight line from the bumper, nearer than the lead."""
    crossed = {
        state.actor.id
        for now in drive("curve_250")
        for state in now.actors
        if state.cuboid.center[0] > 0.0 and abs(state.cuboid.center[1]) < 0.8
    }
    assert crossed - {1}
    assert max(now.yaw_rate_radps for now in drive("curve_250")) == pytest.approx(17.5 / 250.0, rel=0.1)


def test_the_s_curve_turns_both_ways() -> None:
    rates = [now.yaw_rate_radps for now in drive("s_curve")]
    assert max(rates) > 0.1
    assert min(rates) < -0.1


def test_cutting_in_and_out() -> None:
    def nearest(now: World) -> int:
        ahead = [s for s in now.actors if s.cuboid.center[0] > 0.0 and abs(s.cuboid.center[1]) < 1.0]
        return min(ahead, key=lambda s: s.cuboid.center[0]).actor.id

    for name, before, after in (("cut_in", 2, 1), ("cut_out", 1, 2)):
        assert nearest(drive(name)[0]) == before
        assert nearest(drive(name)[-1]) == after
    standing = [now for now in drive("cut_out") if nearest(now) == 2]
    assert 30.0 < gap_m(standing[0], 2) < 60.0, "uncovered late"


def test_the_queue_stops_twice() -> None:
    stands = np.array([now.speed_mps < 0.1 for now in drive("stop_and_go")])
    assert np.count_nonzero(np.diff(stands.astype(int)) == 1) == 2
    assert min(gap_m(now, 1) for now in drive("stop_and_go")) > 4.0


def test_a_pedestrian_crosses_before_the_car_which_waits() -> None:
    worlds = drive("pedestrian_crosses")
    across = [now.t_s for now in worlds if abs(actor(now, 1).cuboid.center[1]) < 0.95]
    assert 6.0 < across[0] < across[-1] < 9.0
    assert min(gap_m(now, 1) for now in worlds if now.t_s in across) > 3.0
    assert actor(worlds[-1], 1).cuboid.center[0] < 0.0, "the car has driven on"
    assert {state.actor.kind for state in worlds[0].actors} == {"pedestrian", "bicycle", "car"}
