"""A minute of a real drive: what the sensors' noise is, and where the path said that the car would go.

u-blox GNSS at 10 Hz, a phone's gyroscope at 100 Hz, the car's own speed (comma2k19, MIT). The road is nearly straight,
8–20 m/s. GNSS columns: latitude, longitude, speed, UTC ms, altitude, course. Gyroscope axes: forward, right, down.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter

from pipeline.params import PathParams
from pipeline.path import map_pose, route_following, yaw_rate
from pipeline.path.route_following import GnssState
from pipeline.path.route_line import lay_out, to_grid
from pipeline.simulation.sensors.gnss_model import MEASURED, RTK
from pipeline.types import F64, EgoState, GnssFix, Route

LATENCY_S = 0.2
"""By how much the receiver's speed lags behind the car's own: a fix gives a past position."""
SIGMA_M = 1.5
SETTLED_S = 6.0
PARAMS = PathParams()


@dataclass(frozen=True)
class Drive:
    """One row per fix. t_s, speed_mps, yaw_rate_radps (mean of the 0.1 s before), course_rad: (N,). places: (N, 2) UTM.
    fixes: as the pipeline takes them."""

    t_s: F64
    speed_mps: F64
    yaw_rate_radps: F64
    yaw_rate_raw: F64
    course_rad: F64
    places: F64
    gnss_speed_mps: F64
    fixes: list[GnssFix]
    epsg: int


@pytest.fixture(scope="module")
def drive(data_dir: Path) -> Drive:
    folder = data_dir / "gps_comma2k19"

    def column(name: str) -> tuple[F64, F64]:
        return np.load(folder / name / "t"), np.load(folder / name / "value")

    t_s, rows = column("GNSS/live_gnss_ublox")
    speed_t, speed = column("CAN/speed")
    gyro_t, gyro = column("IMU/gyro")
    lat, lon, gnss_speed, course = rows[:, 0], rows[:, 1], rows[:, 2], np.radians(rows[:, 5])
    fixes = [
        GnssFix(round((t - LATENCY_S) * 1e9), a, b, 0.0, c, v, "single", SIGMA_M)
        for t, a, b, c, v in zip(t_s, lat, lon, course, gnss_speed, strict=True)
    ]
    line = lay_out(Route("drive", lat, lon, SIGMA_M))
    assert line is not None
    places = np.array([to_grid(line.epsg, a, b)[:2] for a, b in zip(lat, lon, strict=True)])
    yaw = np.array([-gyro[(gyro_t > t - 0.1) & (gyro_t <= t), 2].mean() for t in t_s])
    return Drive(
        t_s, np.interp(t_s, speed_t, speed[:, 0]), yaw, -gyro[:, 2], course, places, gnss_speed, fixes, line.epsg
    )


def predicted(drive: Drive) -> tuple[F64, F64, F64]:
    """(N, 3) lateral distance of the position 1, 2 and 3 s later from the predicted path, and from straight ahead; (N,
    3) the predicted path's sigma there. The pose is the filter's; later positions come from later fixes, which lag by
    the same amount."""
    lat, lon = np.array([[fix.lat_deg, fix.lon_deg] for fix in drive.fixes]).T
    route = Route("so that the pose is kept", lat, lon, SIGMA_M)
    state, yaw, rows = GnssState(), None, []
    for k, fix in enumerate(drive.fixes):
        dt_s = float(drive.t_s[k] - drive.t_s[k - 1]) if k else None
        ego = EgoState(round(drive.t_s[k] * 1e9), float(drive.speed_mps[k]), float(drive.yaw_rate_radps[k]))
        state, _ = route_following.follow(state, route, fix, ego, ego.t_ns, dt_s, PARAMS)
        yaw = yaw_rate.follow(yaw, ego, dt_s, PARAMS)
        path = yaw_rate.ahead(yaw, ego, PARAMS)
        if drive.t_s[k] - drive.t_s[0] < SETTLED_S or drive.t_s[-1] - drive.t_s[k] < 3.3:
            continue
        assert state.pose is not None
        assert path is not None
        then = drive.t_s[k] + LATENCY_S + np.arange(4.0)
        later = np.column_stack([np.interp(then, drive.t_s, column) for column in drive.places.T])
        heading, away = state.pose.mean[2], later[1:] - later[0]
        ahead = away @ [np.cos(heading), np.sin(heading)]
        aside = away @ [-np.sin(heading), np.cos(heading)]
        x, y = path.center.T
        rows.append((aside - np.interp(ahead, x, y), aside, np.interp(ahead, x, path.sigma_m)))
    errors, straight, sigmas = np.array(rows).transpose(1, 0, 2)
    return errors, straight, sigmas


def test_the_predicted_path_is_not_worse_than_constant_heading(drive: Drive) -> None:
    """Constant heading is 0.18 m off after 3 s, with a heading from the last fixes; the filter's heading is better."""
    errors, straight, sigmas = predicted(drive)
    mean, of_heading = np.abs(errors).mean(axis=0), np.abs(straight).mean(axis=0)
    print(f"sideways after 1, 2, 3 s: path {mean.round(3)} m, the filter's heading kept {of_heading.round(3)} m")
    assert mean[0] < 0.05
    assert mean[1] < 0.11
    assert mean[2] < 0.18
    assert of_heading[2] < 0.18
    assert np.mean(np.abs(errors) < 2.0 * sigmas) > 0.95, "the path's own sigma holds"


def test_the_simulators_noise_is_what_was_measured(drive: Drive) -> None:
    white_yaw = drive.yaw_rate_radps - savgol_filter(drive.yaw_rate_radps, 21, 2)
    turned = np.concatenate([[0.0], np.cumsum(np.diff(drive.t_s) * drive.yaw_rate_radps[1:])])
    bias = np.polyfit(drive.t_s, -np.unwrap(drive.course_rad) - turned, 1)[0]
    white_course = drive.course_rad - savgol_filter(drive.course_rad, 31, 2)
    east = drive.places[:, 0] - savgol_filter(drive.places[:, 0], 21, 3)
    lagging = np.interp(drive.t_s - LATENCY_S, drive.t_s, drive.speed_mps)
    print(
        f"yaw rate: white {white_yaw.std():.4f} rad/s, bias {abs(bias):.4f}, raw {drive.yaw_rate_raw.std():.4f}; "
        f"course {np.degrees(white_course.std()):.2f} deg; sideways from fix to fix {east.std():.3f} m; "
        f"speed {np.std(drive.gnss_speed_mps - lagging):.3f} m/s"
    )
    assert white_yaw.std() == pytest.approx(MEASURED.sigma_yaw_rate_radps, rel=0.1)
    assert abs(bias) == pytest.approx(MEASURED.bias_yaw_rate_radps, abs=0.0002)
    assert np.degrees(white_course.std()) == pytest.approx(RTK.sigma_course_deg, rel=0.1)
    assert east.std() < map_pose.WHITE_FLOOR_M < map_pose.white_sigma_m(SIGMA_M)
    assert white_course.std() * drive.speed_mps.mean() == pytest.approx(map_pose.COURSE_SIGMA_MPS, rel=0.15)


def test_a_jump_of_five_metres_is_not_believed(drive: Drive) -> None:
    """All fixes of the real drive pass; a fix that jumps 5 m to the side is rejected, and the pose stays where it
    was."""
    lat, lon = np.array([[fix.lat_deg, fix.lon_deg] for fix in drive.fixes]).T
    route = Route("drive", lat, lon, SIGMA_M)
    state, said = GnssState(), []
    for k, fix in enumerate(drive.fixes[:300]):
        dt_s = float(drive.t_s[k] - drive.t_s[k - 1]) if k else None
        ego = EgoState(round(drive.t_s[k] * 1e9), float(drive.speed_mps[k]), float(drive.yaw_rate_radps[k]))
        before = state
        state, notes = route_following.follow(state, route, fix, ego, ego.t_ns, dt_s, PARAMS)
        said += notes
    assert not said
    jumped = dataclasses.replace(fix, lon_deg=fix.lon_deg + 5.0 / 88_000.0)
    moved, notes = route_following.follow(before, route, jumped, ego, ego.t_ns, dt_s, PARAMS)
    assert notes == ("GNSS jumped by 5.0 m: fix ignored",)
    assert moved.pose is not None
    assert state.pose is not None
    assert np.hypot(*(moved.pose.mean - state.pose.mean)[:2]) < 0.2
    assert moved.doubt_m == pytest.approx(5.0, abs=0.2)
