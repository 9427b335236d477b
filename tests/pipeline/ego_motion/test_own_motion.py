"""Which source own motion is taken from."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.ego_motion import own_motion
from pipeline.ego_motion.own_motion import Measured, OdometryContext, OwnMotionState
from pipeline.params import MotionParams
from pipeline.types import EgoState, Frame, GnssFix
from tests.pipeline.ego_motion.streets import ROAD, seen, street

STREET = street()
CAN = EgoState(0, 12.0, 0.01)


def fix(t_ns: int, speed_mps: float) -> GnssFix:
    return GnssFix(t_ns, 48.0, 11.0, 0.0, 1.0, speed_mps, "single", 2.0)


def driven(source: str, recorded: EgoState | None, gnss_mps: float | None = None, sweeps: int = 6) -> Measured:
    """Own motion after some sweeps at 12 m/s."""
    last = Measured(OwnMotionState(), None, None, ())
    for k in range(sweeps):
        t_ns = k * 100_000_000
        gnss = fix(t_ns, gnss_mps) if gnss_mps is not None else None
        frame = Frame(k, str(k), t_ns, seen(STREET, 1.2 * k, 0.0, 0.0, t_ns), ego=recorded, gnss=gnss)
        params = MotionParams.model_validate({"source": source})
        last = own_motion.measure(last.state, frame, recorded, OdometryContext(ROAD, (), None), 0.1, params)
    return last


@pytest.mark.parametrize(
    ("source", "recorded", "gnss_mps", "speed_from", "yaw_rate_from"),
    [
        ("auto", CAN, 12.0, "can", "can"),
        ("auto", None, None, "lidar", "lidar"),
        ("auto", EgoState(0, 12.0, None), None, "can", "lidar"),
        ("auto", None, 12.0, "gnss", "lidar"),
        ("can", CAN, 12.0, "can", "can"),
        ("can", None, 12.0, None, None),
        ("gnss", CAN, 12.0, "gnss", None),
        ("lidar", CAN, 12.0, "lidar", "lidar"),
        ("off", CAN, 12.0, None, None),
    ],
)
def test_the_surest_of_those_that_may_be_asked(
    source: str, recorded: EgoState | None, gnss_mps: float | None, speed_from: str | None, yaw_rate_from: str | None
) -> None:
    last = driven(source, recorded, gnss_mps)
    assert (last.ego is None) == (speed_from is None)
    if last.ego is not None and last.own is not None:
        assert last.own.speed.source == last.ego.source == speed_from
        assert (last.own.turning.source if last.own.turning else None) == yaw_rate_from
        assert last.ego.speed_mps == pytest.approx(12.0, abs=0.4)
        assert (last.ego.yaw_rate_radps is None) == (yaw_rate_from is None)


def test_what_is_recorded_is_passed_on_as_it_is_and_the_lidar_not_asked() -> None:
    last = driven("auto", CAN)
    assert last.ego is CAN
    assert last.state.odometry.clouds == ()


def test_a_lidar_that_sees_too_little_is_said_only_where_it_is_missed() -> None:
    bare = Frame(1, "1", 0, seen(STREET[:3], 0.0, 0.0, 0.0, 1), gnss=fix(0, 12.0))
    params, around = MotionParams(), OdometryContext(ROAD, (), None)
    assert own_motion.measure(OwnMotionState(), bare, None, around, 0.1, params).notes == ()
    alone = own_motion.measure(OwnMotionState(), replace(bare, gnss=None), None, around, 0.1, params)
    assert alone.notes == ("LiDAR odometry: too few static objects nearby",)


def test_a_bus_that_counts_in_miles_is_contradicted() -> None:
    (note,) = driven("lidar", EgoState(0, 7.5, 0.0)).notes
    assert note.startswith("ego speed: LiDAR 4")
    assert note.endswith("km/h, CAN 27 km/h")
    assert driven("auto", CAN, gnss_mps=20.0).notes == ("ego speed: CAN 43 km/h, GNSS 72 km/h",)
    assert driven("lidar", CAN).notes == ()


def test_a_yaw_rate_of_the_wrong_sign_is_contradicted_and_a_late_receiver_is_not() -> None:
    (note,) = driven("lidar", EgoState(0, 12.0, 0.2, source="ins")).notes
    assert note.startswith("yaw rate: LiDAR ")
    assert note.endswith("°/s, IMU +11°/s")
    assert driven("lidar", EgoState(0, 12.0, 0.2, source="gnss")).notes == ()


@pytest.mark.parametrize(
    ("source", "recorded", "gnss_mps", "says"),
    [
        ("can", None, 12.0, "ego motion: no data from CAN; GNSS available but not used"),
        ("gnss", CAN, None, "ego motion: no data from GNSS; CAN available but not used"),
        ("gnss", None, None, None),
        ("off", CAN, 12.0, None),
    ],
)
def test_a_source_that_is_asked_for_and_not_there_is_said(
    source: str, recorded: EgoState | None, gnss_mps: float | None, says: str | None
) -> None:
    last = driven(source, recorded, gnss_mps)
    assert last.ego is None
    assert last.notes == ((says,) if says else ())
