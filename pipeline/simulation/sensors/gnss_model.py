"""A scenario's place on the Earth and the noise of its GNSS receiver: the ``gnss`` part of a scenario file. The noise
of the car's own motion: the ``odometry`` part.

The noise was measured on 60 s of a real drive (comma2k19: u-blox receiver, phone gyroscope, speed from the car's bus;
tests/accuracy/test_comma2k19.py repeats the measurement): course 0.31° at 17 m/s; yaw rate 0.0024 rad/s white when
averaged over 0.1 s, with a bias of 0.0005 rad/s; speed 0.08 m/s against the receiver's. The position noise is that of
RTK, as in the paper: that drive's receiver was off by metres, but scattered by only 0.02 m sideways from fix to fix.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.world.roads import ScenarioPart


class GnssModel(ScenarioPart):
    """Origin of the world, and accuracy of the receiver (standard deviations)."""

    lat_deg: float = Field(default=35.6506, ge=-85.0, le=85.0)
    """Of the origin, WGS 84."""
    lon_deg: float = Field(default=128.4022, ge=-180.0, le=180.0)
    """Of the origin, WGS 84."""
    alt_m: float = Field(default=40.0, ge=-400.0, le=6000.0)
    """Of the origin."""
    x_axis_deg: float = Field(default=90.0, ge=0.0, lt=360.0)
    """Direction of the world's x axis, clockwise from north."""
    sigma_m: float = Field(default=0.01, ge=0.0, le=20.0)
    """Of the position, along east and north each."""
    sigma_up_m: float = Field(default=0.02, ge=0.0, le=20.0)
    """Of the height above the ellipsoid."""
    sigma_speed_mps: float = Field(default=0.02, ge=0.0, le=5.0)
    """Of the receiver's Doppler speed."""
    sigma_course_deg: float = Field(default=0.3, ge=0.0, le=45.0)
    """Of the direction of travel."""


class OdometryModel(ScenarioPart):
    """Errors of the car's own measurements."""

    sigma_yaw_rate_radps: float = Field(default=0.0024, ge=0.0, le=0.5)
    """Standard deviation of the yaw rate."""
    bias_yaw_rate_radps: float = Field(default=0.0005, ge=-0.5, le=0.5)
    """Constant error of the yaw rate."""
    sigma_speed_mps: float = Field(default=0.02, ge=0.0, le=5.0)
    """Standard deviation of the speed."""


RTK = GnssModel()
"""An RTK fix, near the proving ground of the paper (Daegu)."""
MEASURED = OdometryModel()
"""As measured on a real drive."""
