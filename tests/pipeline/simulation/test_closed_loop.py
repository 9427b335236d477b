"""The loop is closed: the pipeline's commands move the car, and the same drive is reproduced."""

from __future__ import annotations

from itertools import pairwise

import pytest

from pipeline.params import Params, with_changes
from pipeline.simulation.closed_loop import LoopStep, NetworkEyes, Setup, drive
from pipeline.simulation.scenario import Scenario
from pipeline.types import RawBoxes
from tests.pipeline.simulation.worlds import with_actors

SLOWER = "{id: 1, kind: car, lane: -2, ahead_m: 28, speed_mps: {0: 12}}"


def short(actors: str, seconds: float = 4.0) -> Scenario:
    return with_actors(actors).model_copy(update={"duration_s": seconds})


def ticks(setup: Setup, actors: str = SLOWER) -> list[LoopStep]:
    return list(drive(short(actors), setup))


def test_closed_the_car_brakes_for_its_lead_and_open_it_follows_its_script() -> None:
    closed, scripted = ticks(Setup()), ticks(Setup(closed=False))
    assert closed[-1].vehicle.speed_mps < 16.0
    assert scripted[-1].vehicle.speed_mps == 20.0
    assert scripted[-1].world.s_m - scripted[0].world.s_m == pytest.approx(20.0 * scripted[-1].t_s)
    assert any(tick.result.acc is not None and tick.result.acc.brake > 0.0 for tick in scripted), "it is only noted"


def test_with_nothing_ahead_the_car_speeds_up_to_its_set_speed() -> None:
    params = with_changes(Params(), {"acc.set_speed_kmh": 80.0})
    speeds = [tick.vehicle.speed_mps for tick in drive(short("", 8.0), Setup(params, "lidar"))]
    assert speeds[-1] == pytest.approx(80.0 / 3.6, abs=0.3)
    assert all(b >= a - 0.05 for a, b in pairwise(speeds))


def test_the_command_of_a_tick_acts_after_it_not_before() -> None:
    drove = ticks(Setup())
    first = next(n for n, tick in enumerate(drove) if tick.result.acc is not None and tick.result.acc.brake > 0.05)
    assert drove[first].vehicle.accel_mps2 >= -0.01
    assert drove[first + 2].vehicle.accel_mps2 < -0.05


def test_the_same_drive_twice() -> None:
    a, b = (ticks(Setup()) for _ in range(2))
    assert [tick.vehicle for tick in a] == [tick.vehicle for tick in b]
    assert [tick.result.cipv for tick in a] == [tick.result.cipv for tick in b]


@pytest.mark.parametrize(("sensors", "sources"), [("lidar", {"L"}), ("camera", {"V"}), ("both", {"L", "V", "VL"})])
def test_sensors_left_out_see_nothing(sensors: str, sources: set[str]) -> None:
    seen = {item.source for tick in ticks(Setup(sensors=sensors)) for item in tick.result.objects}  # type: ignore[arg-type]
    assert seen
    assert seen <= sources


def test_a_network_gets_the_drawn_image() -> None:
    class Counting:
        name = "counting"

        def __init__(self) -> None:
            self.shapes: list[tuple[int, ...]] = []

        def detect(self, bgr):  # type: ignore[no-untyped-def]
            self.shapes.append(bgr.shape)
            return RawBoxes("counting", bgr[:0, :4, 0].astype("float32").reshape(-1, 4), bgr[:0, 0, 0], ())

    counting = Counting()
    scene = short(SLOWER, 0.3)
    drove = list(drive(scene, Setup(eyes=NetworkEyes(counting))))  # type: ignore[arg-type]
    assert counting.shapes == [(720, 1280, 3)] * 3
    assert all(tick.frame.image is not None for tick in drove)
