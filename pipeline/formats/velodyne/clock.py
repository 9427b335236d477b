"""Full timestamps from a Velodyne's clock, which counts microseconds past the hour without stating the hour."""

from __future__ import annotations

from typing import Literal

from pipeline.formats.velodyne.packet import HOUR_US

_HOUR_NS = HOUR_US * 1000
_DRIFT_PER_NS = 50e-6  # what two crystals may drift apart
_STEP_NS = 500_000_000
_STEP_LASTS_US = 2_000_000

Reference = Literal["gps", "host", "sensor"]


class SensorClock:
    """Sensor time → nanoseconds.

    - ``gps``: the sensor follows a GPS receiver (PPS): its time is UTC past the hour, the host only says which hour.
    - ``host``: it counts since it was switched on. Its steps are kept, which are exact to the microsecond, and its
      beginning is set by the packets that took the shortest way: the smallest of host − sensor, which may rise by
      50 ppm only. A packet that waited in a queue does not move it. A host clock set anew is followed after 2 s.
    - ``sensor``: no host time either; time begins at the sensor's own hour.
    """

    def __init__(self) -> None:
        self._follows_gps = False
        self._offset_ns: float | None = None
        self._anchor_us = 0
        self._stepped_since_us: int | None = None

    @property
    def reference(self) -> Reference:
        """Which of the three the last time given was taken by."""
        return "gps" if self._follows_gps else "host" if self._offset_ns is not None else "sensor"

    @property
    def offset_ns(self) -> int | None:
        """Host time less the sensor's, as it stands; None without host time."""
        return None if self._offset_ns is None else round(self._offset_ns)

    def follow_gps(self, locked: bool) -> None:
        """What the last position packet says: whether the sensor's time is UTC."""
        self._follows_gps = locked

    def restart(self) -> None:
        """The sensor's own time begins anew: what is known about its beginning is void."""
        self._offset_ns = self._stepped_since_us = None

    def observe(self, sensor_us: int, t_host_ns: int) -> None:
        """A packet whose last laser fired at ``sensor_us`` (counted on over the hours) came at ``t_host_ns``."""
        seen = float(t_host_ns - sensor_us * 1000)
        if self._offset_ns is None:
            self._offset_ns, self._anchor_us = seen, sensor_us
            return
        allowed = self._offset_ns + max(0, sensor_us - self._anchor_us) * 1000 * _DRIFT_PER_NS
        self._anchor_us = max(sensor_us, self._anchor_us)
        if abs(seen - allowed) < _STEP_NS:
            self._stepped_since_us = None
        elif self._stepped_since_us is None:
            self._stepped_since_us = sensor_us
        if self._stepped_since_us is not None:
            if sensor_us - self._stepped_since_us < _STEP_LASTS_US:
                self._offset_ns = allowed
                return
            self._stepped_since_us, allowed = None, seen
        self._offset_ns = min(seen, allowed)

    def to_ns(self, sensor_us: float) -> int:
        """Nanoseconds of a moment of the sensor's clock (counted on over the hours)."""
        own_ns = round(sensor_us * 1000)
        if self._offset_ns is None:
            return own_ns
        host_ns = own_ns + round(self._offset_ns)
        if not self._follows_gps:
            return host_ns
        hours = round((host_ns - own_ns) / _HOUR_NS)
        return own_ns + hours * _HOUR_NS
