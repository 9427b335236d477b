"""The constant-velocity filter: against textbook forms, and in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common import kalman

R = np.diag([0.04, 0.09])


def test_prediction_moves_with_the_velocity_and_grows_less_certain() -> None:
    state = kalman.CvState(np.array([10.0, 1.0, -2.0, 0.5]), np.eye(4))
    later = kalman.predict(state, 0.5, accel_sigma=3.0)
    assert later.mean == pytest.approx([9.0, 1.25, -2.0, 0.5])
    assert np.all(np.diag(later.cov)[:2] > np.diag(state.cov)[:2])


def test_zero_time_changes_nothing() -> None:
    state = kalman.start((3.0, -1.0), R, 10.0)
    same = kalman.predict(state, 0.0, 3.0)
    assert np.array_equal(same.mean, state.mean)
    assert np.array_equal(same.cov, state.cov)


def test_time_does_not_run_back() -> None:
    with pytest.raises(ValueError, match="back in time"):
        kalman.predict(kalman.start((0.0, 0.0), R, 1.0), -0.1, 1.0)


def test_update_is_the_information_weighted_mean() -> None:
    """Against the information form, which shares no code with the gain form."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    prior = kalman.CvState(rng.normal(size=4), A @ A.T + np.eye(4))
    z = np.array([1.0, -2.0])
    H = np.eye(4)[:2]
    information = np.linalg.inv(prior.cov) + H.T @ np.linalg.inv(R) @ H
    mean = np.linalg.solve(information, np.linalg.inv(prior.cov) @ prior.mean + H.T @ np.linalg.inv(R) @ z)
    got = kalman.update(prior, z, R)
    assert got.mean == pytest.approx(mean)
    assert got.cov == pytest.approx(np.linalg.inv(information))


@pytest.mark.parametrize("dt_s", [0.02, 0.1, 0.3])
def test_finds_the_velocity_of_a_steady_mover_at_any_rate(dt_s: float) -> None:
    state = kalman.start((30.0, 2.0), R, 20.0)
    for k in range(1, 60):
        state = kalman.predict(state, dt_s, 0.1)
        state = kalman.update(state, (30.0 - 4.0 * k * dt_s, 2.0 + 0.5 * k * dt_s), R)
    assert state.mean[2:] == pytest.approx([-4.0, 0.5], abs=0.05)


def test_noise_is_what_the_filter_says_it_is() -> None:
    """Consistency (NEES): over many runs the mean squared error in sigmas is the number of states, 4 ± 5 %."""
    rng = np.random.default_rng(11)
    dt_s, accel, nees = 0.1, 2.0, []
    for _ in range(400):
        truth = np.array([20.0, 0.0, *rng.normal(0.0, 5.0, 2)])
        state = kalman.start(truth[:2] + rng.multivariate_normal([0, 0], R), R, 5.0)
        for _ in range(20):
            push = rng.normal(0.0, accel, 2)
            truth = np.concatenate([truth[:2] + dt_s * truth[2:] + dt_s**2 / 2 * push, truth[2:] + dt_s * push])
            state = kalman.update(kalman.predict(state, dt_s, accel), truth[:2] + rng.multivariate_normal([0, 0], R), R)
        error = state.mean - truth
        nees.append(error @ np.linalg.solve(state.cov, error))
    assert np.mean(nees) == pytest.approx(4.0, rel=0.1)


@given(
    st.lists(st.tuples(st.floats(-80, 80), st.floats(-80, 80), st.floats(0.0, 2.0)), min_size=1, max_size=20),
    st.floats(0.1, 20.0),
)
def test_covariance_stays_symmetric_and_positive(steps: list[tuple[float, float, float]], accel: float) -> None:
    state = kalman.start(steps[0][:2], R, 10.0)
    for x, y, dt_s in steps:
        state = kalman.update(kalman.predict(state, dt_s, accel), (x, y), R)
        assert np.array_equal(state.cov, state.cov.T)
        assert np.linalg.eigvalsh(state.cov).min() > -1e-9


@given(st.floats(-50, 50), st.floats(-50, 50))
def test_mahalanobis_counts_sigmas(dx: float, dy: float) -> None:
    state = kalman.start((1.0, 2.0), R, 1.0)
    expected = dx**2 / (2 * R[0, 0]) + dy**2 / (2 * R[1, 1])
    assert kalman.mahalanobis2(state, (1.0 + dx, 2.0 + dy), R) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_many_states_at_once_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(5)
    places, seen = rng.normal(0.0, 20.0, (7, 2)), rng.normal(0.0, 20.0, (7, 2))
    together = kalman.update(kalman.predict(kalman.start(places, R, 9.0), 0.1, 2.0), seen, R)
    for i in range(7):
        alone = kalman.update(kalman.predict(kalman.start(places[i], R, 9.0), 0.1, 2.0), seen[i], R)
        assert together.mean[i] == pytest.approx(alone.mean, abs=1e-12)
        assert together.cov[i] == pytest.approx(alone.cov, abs=1e-12)
