"""Scenario files: what is refused, and how the built-in drive goes, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.simulation import built_in, scenario
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState, World

FILES = {
    name: (Path(scenario.__file__).parent / "scenarios" / f"{name}.yaml").read_text(encoding="utf-8")
    for name in built_in.names()
}
STRAIGHT = FILES["straight"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("title:", "titel:"), "t.yaml: title: is missing"),
        (("seed: 7", "seed: 7\nweather: rain"), "t.yaml: weather: no such setting"),
        (("seed: 7", "seed: 7\nfurther_sensors: [sonar]"), "no simulated sensor 'sonar'; available: "),
        (("kind: van", "kind: boat"), "actors.3.kind: Input should be"),
        (("id: 8,", "id: 1,"), "two actors have the same id"),
        (("lanes_forward: 3", "lanes_forward: 2"), "no lane -3"),
        (("  lane: -2", "  lane: 1"), "the ego vehicle must drive along the road"),
        (("lane: -2}]", "lane: 1}]"), "leads to the other carriageway"),
        (("{0: 28}", "{0: .nan}"), "finite number"),
        (("{0: 28}", "{0: 300}"), "between 0 and 100 m/s"),
        (("{0: 28}", "{}"), "at least 1 item"),
        (("road:", "road: ["), "not YAML"),
    ],
)
def test_a_wrong_file_is_told_in_one_sentence(change: tuple[str, str], says: str) -> None:
    assert change[0] in STRAIGHT
    with pytest.raises(ScenarioError) as error:
        scenario.parse(STRAIGHT.replace(*change), "t.yaml")
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@settings(max_examples=120, deadline=None)
@given(st.sampled_from(sorted(FILES)), st.floats(0, 1), st.integers(0, 30), st.text("0123456789.-: ae{[,", max_size=12))
def test_damage_is_survived(name: str, share: float, drop: int, extra: str) -> None:
    text = FILES[name]
    at = int(share * len(text))
    try:
        parsed = scenario.parse(text[:at] + extra + text[at + drop :], "t.yaml")
    except ScenarioError:
        return
    world_state.at(parsed, 1.0)


def test_every_built_in_scenario_loads() -> None:
    assert "straight" in built_in.names()
    for name in built_in.names():
        assert scenario.load(name).frame_count() > 0


# ---------------------------------------------------------------- the drive called "straight"


@pytest.fixture(scope="module")
def drive() -> list[World]:
    built_in = scenario.load("straight")
    return [world_state.at(built_in, i / 10) for i in range(built_in.frame_count())]


def actor(now: World, number: int) -> ActorState:
    return next(state for state in now.actors if state.actor.id == number)


def gap_m(state: ActorState) -> float:
    return state.cuboid.center[0] - state.cuboid.size[0] / 2


def test_the_lead_comes_from_55_m_to_22_m(drive: list[World]) -> None:
    gaps = [gap_m(actor(now, 1)) for now in drive]
    assert gaps[0] == pytest.approx(55.0)
    assert 20.0 < min(gaps) < 24.0
    assert np.all(np.diff(gaps[:85]) < 0.0), "closing all the way down"


def test_the_gap_to_what_is_in_the_ego_lane_stays_safe(drive: list[World]) -> None:
    for now in drive:
        for state in now.actors:
            if abs(state.cuboid.center[1]) < 1.8 and state.cuboid.center[0] > 0.0:
                assert gap_m(state) > 10.0, f"actor {state.actor.id} at {now.t_s} s"
    assert min(gap_m(actor(now, 1)) for now in drive) > 15.0


def test_the_cut_in_becomes_the_nearest_in_lane(drive: list[World]) -> None:
    def nearest(now: World) -> int:
        ahead = [s for s in now.actors if abs(s.cuboid.center[1]) < 1.0 and s.cuboid.center[0] > 0.0]
        return min(ahead, key=gap_m).actor.id

    assert nearest(drive[140]) == 1
    assert nearest(drive[180]) == 2
    assert 12.0 < gap_m(actor(drive[160], 2)) < 25.0
    assert abs(actor(drive[160], 2).cuboid.yaw_rad) > 0.03, "it points to where it goes"


def test_nobody_drives_into_anybody(drive: list[World]) -> None:
    for now in drive:
        boxes = [(s.cuboid.center[0], s.cuboid.center[1], *s.cuboid.size[:2]) for s in now.actors]
        boxes.append((-2.3, 0.0, 4.6, 1.9))
        for i, (x, y, length, width) in enumerate(boxes):
            for other in boxes[i + 1 :]:
                apart = abs(x - other[0]) > (length + other[2]) / 2 or abs(y - other[1]) > (width + other[3]) / 2
                assert apart, f"at {now.t_s} s"


def test_the_ego_car_drives_plausibly(drive: list[World]) -> None:
    speeds = np.array([now.speed_mps for now in drive])
    assert speeds[0] == 20.0
    assert np.abs(np.diff(speeds) * 10).max() < 2.0
    assert all(now.yaw_rate_radps == 0.0 for now in drive)


def test_lead_brakes_show(drive: list[World]) -> None:
    assert not actor(drive[20], 1).braking
    assert actor(drive[55], 1).braking


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(STRAIGHT, encoding="utf-8")
    assert isinstance(scenario.load(str(path)), Scenario)
