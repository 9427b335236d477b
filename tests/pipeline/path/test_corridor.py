"""The corridor bends along the true arc, and offsets are measured from it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.params import PathParams
from pipeline.path.corridor import Evidence, PathState, corridor, nearest_on_path, offset, predict
from pipeline.path.estimates import arc, samples
from pipeline.types import EgoState, GnssFix, Moment, Path, Route

PARAMS = PathParams()


def ego(speed_mps: float, yaw_rate_radps: float | None) -> EgoState:
    return EgoState(0, speed_mps, yaw_rate_radps)


def test_the_arc_is_not_twice_as_curved() -> None:
    """20 m/s and 0.1 rad/s give a radius of 200 m: 20 m along the arc, the offset is 1.00 m, not 2.00 m."""
    path = corridor(ego(20.0, 0.1), PARAMS)
    assert path.source == "yaw_rate"
    assert path.center[20] == pytest.approx([200 * np.sin(0.1), 200 * (1 - np.cos(0.1))], abs=1e-3)
    assert path.center[20, 1] == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize(
    ("state", "source"),
    [
        pytest.param(None, "straight", id="no ego state"),
        pytest.param(ego(20.0, None), "straight", id="no yaw rate"),
        pytest.param(ego(0.5, 0.3), "straight", id="too slow for the yaw rate to mean a curve"),
        pytest.param(ego(20.0, 0.0), "yaw_rate", id="yaw rate says straight on"),
    ],
)
def test_source_of_the_path(state: EgoState | None, source: str) -> None:
    path = corridor(state, PARAMS)
    assert path.source == source
    assert np.allclose(path.center[:, 1], 0.0)
    assert path.weights == {source: 1.0}


def test_a_guess_is_less_sure_than_a_measurement() -> None:
    """As far ahead as a yaw rate is useful, two seconds of driving."""
    guessed, measured = corridor(None, PARAMS), corridor(ego(20.0, 0.0), PARAMS)
    assert guessed.sigma_m["30"] > 1.5 * measured.sigma_m["30"] > measured.sigma_m["10"] > 0.0


def test_what_is_right_ahead_of_a_standing_car_is_in_its_path_whatever_a_vague_route_says() -> None:
    """A single receiver is wrong by metres: by the route, a truck three metres ahead in a queue was not the lead."""
    route = Route("street", np.linspace(-0.001, 0.002, 200), np.zeros(200), 0.1)
    standing = EgoState(0, 0.0, 0.0)
    state = PathState()
    for n, speed_mps in enumerate((10.0,) * 5 + (0.0,) * 30):
        t_ns = n * 100_000_000
        moving = speed_mps > 0.0
        fix = GnssFix(t_ns, min(n, 5) * 9e-6, 3e-5, 0.0, 0.0 if moving else None, speed_mps, "single", 5.0)
        own = EgoState(t_ns, speed_mps, 0.0) if moving else standing
        now = Moment(t_ns, 0.1 if n else None, own, own)
        state, path = predict(state, Evidence(None, fix, route), now, PARAMS)
    assert path.profile_m[3] < 1.0
    assert abs(path.center[3, 1]) < 1.0


def test_left_is_left() -> None:
    path = corridor(ego(20.0, 0.1), PARAMS)
    assert path.center[-1, 1] > 0
    assert np.all(np.hypot(*(path.left - path.center).T) == pytest.approx(PARAMS.half_width_m))
    assert path.left[0] == pytest.approx([0.0, PARAMS.half_width_m], abs=1e-4)
    assert path.right[0] == pytest.approx([0.0, -PARAMS.half_width_m], abs=1e-4)


@given(
    curvature=st.floats(-0.02, 0.02),
    s=st.floats(1.0, 70.0),
    aside=st.floats(-5.0, 5.0),
)
def test_offset_of_a_point_set_beside_the_arc(curvature: float, s: float, aside: float) -> None:
    """A point ``aside`` metres from the arc at path length s is located there, within the chords' sagitta."""
    center, _ = arc(curvature, samples(PARAMS.length_m))
    path = Path("fused", center, center, center, PARAMS.half_width_m, {}, {})
    point, heading = arc(curvature, np.array([s]))
    normal = np.array([-np.sin(heading[0]), np.cos(heading[0])])
    there = point + aside * normal
    found, reached = nearest_on_path(path, there)
    assert found[0] == pytest.approx(aside, abs=0.01)
    assert reached[0] == pytest.approx(s, abs=0.1)


def test_a_point_behind_has_negative_path_length() -> None:
    path = corridor(None, PARAMS)
    assert nearest_on_path(path, np.array([[-4.0, 1.0]]))[1][0] == pytest.approx(-4.0)
    assert offset(path, np.array([[-4.0, 1.0]]))[0] == pytest.approx(1.0)


def test_a_hairpin_does_not_lead_behind_the_car() -> None:
    path = corridor(ego(3.0, 1.0), PARAMS)
    assert path.center[:, 0].min() >= 0.0
    assert np.all(np.diff(path.center[:, 1]) >= -1e-9)
