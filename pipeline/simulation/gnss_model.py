"""Where in the world a scenario lies and how good its GNSS receiver is: the ``gnss`` part of a scenario file."""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.roads import Strict


class GnssModel(Strict):
    """Where the world's origin is, which way its x axis points (degrees clockwise from north), and how good the
    receiver is: standard deviations of place (each way), height, speed and course."""

    lat_deg: float = Field(default=35.6506, ge=-85.0, le=85.0)
    lon_deg: float = Field(default=128.4022, ge=-180.0, le=180.0)
    alt_m: float = Field(default=40.0, ge=-400.0, le=6000.0)
    x_axis_deg: float = Field(default=90.0, ge=0.0, lt=360.0)
    sigma_m: float = Field(default=0.01, ge=0.0, le=20.0)
    sigma_up_m: float = Field(default=0.02, ge=0.0, le=20.0)
    sigma_speed_mps: float = Field(default=0.02, ge=0.0, le=5.0)
    sigma_course_deg: float = Field(default=0.2, ge=0.0, le=45.0)


RTK = GnssModel()
"""An RTK fix, near the proving ground of the paper (Daegu)."""
