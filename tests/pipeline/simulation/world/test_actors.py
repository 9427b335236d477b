"""Scripts: speeds in time, ways driven, lane changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.simulation.world.actors import Script, motion
from pipeline.simulation.world.roads import Road, Segment

ROAD = Road(segments=(Segment(length_m=1000.0),))


TIMES = st.floats(0, 20, allow_subnormal=False)


@given(st.dictionaries(TIMES, st.floats(0, 40), min_size=1, max_size=6), st.floats(0, 25, allow_subnormal=False))
def test_the_way_driven_is_the_integral_of_the_speed(speeds: dict[float, float], t_s: float) -> None:
    times, values = np.array(sorted(speeds)), np.array([speeds[time] for time in sorted(speeds)])
    now = motion(Script(lane=-1, speed_mps=speeds), ROAD, t_s)
    fine = np.unique(np.concatenate([np.linspace(0.0, t_s, 3000), times[times < t_s]]))
    assert now.speed_mps == pytest.approx(np.interp(t_s, times, values))
    assert now.travelled_m == pytest.approx(np.trapezoid(np.interp(fine, times, values), fine), abs=1e-6)


def test_acceleration_is_the_slope() -> None:
    script = Script(lane=-1, speed_mps={0: 10, 10: 30})
    assert motion(script, ROAD, 5.0).accel_mps2 == pytest.approx(2.0)
    assert motion(script, ROAD, 15.0).accel_mps2 == 0.0


def test_a_lane_change_is_smooth_and_ends_in_the_lane() -> None:
    change = {"start_s": 2.0, "duration_s": 4.0, "lane": -2}
    script = Script.model_validate({"lane": -1, "speed_mps": {0: 20}, "lane_changes": [change]})
    d = [motion(script, ROAD, t).d_m for t in (0.0, 2.0, 4.0, 6.0, 9.0)]
    assert d == pytest.approx([-3.8, -3.8, -5.6, -7.4, -7.4])
    t = np.linspace(1.5, 6.5, 501)
    states = [motion(script, ROAD, float(time)) for time in t]
    rates, accels = np.array([s.d_rate_mps for s in states]), np.array([s.d_accel_mps2 for s in states])
    np.testing.assert_allclose(np.gradient([s.d_m for s in states], t)[1:-1], rates[1:-1], atol=2e-3)
    np.testing.assert_allclose(np.gradient(rates, t)[1:-1], accels[1:-1], atol=2e-2)
    assert np.abs(accels).max() < 3.0


def test_braking_starts_in_time_and_ends_at_its_speed() -> None:
    brake = {"at_s": 3.0, "decel_mps2": 4.0, "to_mps": 6.0}
    script = Script.model_validate({"lane": -1, "speed_mps": {0: 10, 2: 20, 8: 40}, "brake": brake})
    speeds = [motion(script, ROAD, t).speed_mps for t in (0.0, 2.0, 3.0, 4.0, 20.0)]
    start = 20 + 20 / 6
    assert speeds == pytest.approx([10.0, 20.0, start, start - 4.0, 6.0])
    assert motion(script, ROAD, 3.5).accel_mps2 == pytest.approx(-4.0)


@pytest.mark.parametrize("brake", [{"decel_mps2": 3}, {"at_s": 1, "at_gap_m": 20, "decel_mps2": 3}])
def test_braking_needs_one_start(brake: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="at_s or at_gap_m"):
        Script.model_validate({"lane": -1, "speed_mps": {0: 10}, "brake": brake})


def test_an_offset_stays_through_a_lane_change() -> None:
    change = {"start_s": 2.0, "duration_s": 4.0, "lane": -2}
    script = Script.model_validate({"lane": -1, "offset_m": 0.5, "speed_mps": {0: 20}, "lane_changes": [change]})
    assert [motion(script, ROAD, t).d_m for t in (0.0, 9.0)] == pytest.approx([-3.3, -6.9])


def test_a_lane_change_that_is_broken_off_keeps_what_it_reached() -> None:
    """Half of its time is half of its way; another change starts from there."""
    road = Road(segments=(Segment(length_m=500),), lane_width_m=4.0, median_m=0.0)
    changes = (
        {"start_s": 2.0, "duration_s": 4.0, "lane": -2, "until_s": 4.0},
        {"start_s": 5.0, "duration_s": 2.0, "lane": -1},
    )
    script = Script.model_validate({"lane": -1, "speed_mps": {0: 20}, "lane_changes": changes})
    assert [motion(script, road, t_s).d_m for t_s in (2.0, 4.0, 4.9, 6.0, 8.0)] == pytest.approx([-2, -4, -4, -3, -2])
    assert motion(script, road, 4.5).d_rate_mps == 0.0
