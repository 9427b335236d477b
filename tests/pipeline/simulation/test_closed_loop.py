"""The loop is closed: the pipeline's commands move the car, and the same drive is reproduced."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.params import Params, with_changes
from pipeline.simulation.closed_loop import LoopStep, NetworkEyes, Setup, TruthEyes, drive
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.sensors.faults import Faults, Knock
from pipeline.types import F64, RawBoxes
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


def edges_px(tick: LoopStep) -> F64 | None:
    """(4,) of the only vehicle's box; None if it is not detected."""
    boxes = tick.frame.raw_boxes.boxes if tick.frame.raw_boxes is not None else ()
    return np.asarray(boxes[0], dtype=np.float64) if len(boxes) else None


def test_the_cars_sensors_have_the_scenarios_faults() -> None:
    faults = Faults(knock=Knock(at_s=1.0, yaw_deg=3.0), sweeps_lost=0.3, pictures_lost=0.3)
    eyes = TruthEyes(BoxNoise(lasting_share=0.0, frame_share=0.0, edge_px=0.0, missed=0.0))
    right, wrong = (list(drive(scene, Setup(eyes=eyes, closed=False))) for scene in (short(SLOWER, 2.0), with_(faults)))
    lost = [sum(each(tick) is None for tick in wrong) for each in (lambda tick: tick.frame.sweep, edges_px)]
    assert all(0 < count < len(wrong) for count in lost)
    off_px = [
        (own.t_s >= 1.0, seen[0] - there[0])
        for own, other in zip(right, wrong, strict=True)
        if (there := edges_px(own)) is not None and (seen := edges_px(other)) is not None
    ]
    camera, calibrated = wrong[-1].frame.camera, right[-1].frame.camera
    assert camera is not None
    assert calibrated is not None
    turned_px = camera.K[0, 0] * np.tan(np.radians(3.0))
    assert all(off == pytest.approx(turned_px, rel=0.3) for is_knocked, off in off_px if is_knocked)
    assert all(off == pytest.approx(0.0, abs=1e-3) for is_knocked, off in off_px if not is_knocked)
    assert (camera.T_camera_ego == calibrated.T_camera_ego).all(), "the calibration does not know of it"


def test_a_late_image_shows_the_lead_nearer() -> None:
    def height_px(skew_ms: float) -> float:
        eyes = TruthEyes(BoxNoise(lasting_share=0.0, frame_share=0.0, edge_px=0.0, missed=0.0))
        *_, last = drive(with_(Faults(camera_skew_ms=skew_ms), 0.5), Setup(eyes=eyes))
        edges = edges_px(last)
        assert edges is not None
        return float(edges[3] - edges[1])

    assert height_px(-200.0) < height_px(0.0) < height_px(200.0), "the car catches up with its lead"


def with_(faults: Faults, seconds: float = 2.0) -> Scenario:
    return short(SLOWER, seconds).model_copy(update={"faults": faults})
