"""The data of a drive that scores without labels need: numbers only, about 20 bytes per object and frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pipeline.decision.object_motion import closing_speed_mps
from pipeline.types import F64, I64, FusedObject, Result

NONE = -1
"""The id of no object."""

SIGHTING = np.dtype(
    [
        ("frame", "i4"),
        ("id", "i4"),
        ("ranged", "?"),
        ("by_camera", "?"),
        ("carried", "?"),
        ("two_sensors", "?"),
        ("in_path", "?"),
        ("distance_m", "f4"),
        ("closing_mps", "f4"),
    ]
)
"""One object in one frame. ``ranged``: its distance was measured by the LiDAR or another ranging sensor in this frame;
``by_camera``: only the camera sees it, and its distance was measured from its image box in this frame. NaN: unknown."""
SightingRecords = npt.NDArray[np.void]


@dataclass
class History:
    """A drive, filled frame by frame."""

    _t_ns: list[int] = field(default_factory=list)
    _lead: list[int] = field(default_factory=list)
    _parts: list[SightingRecords] = field(default_factory=list)

    def add(self, result: Result) -> None:
        """Add the next frame."""
        frame = len(self._t_ns)
        part = np.zeros(len(result.objects), SIGHTING)
        for place, item in enumerate(result.objects):
            part[place] = _sighting(frame, item)
        self._t_ns.append(result.t_ns)
        self._lead.append(result.cipv.id if result.cipv is not None else NONE)
        self._parts.append(part)

    @property
    def t_ns(self) -> I64:
        """(N,) tick of each frame."""
        return np.array(self._t_ns, np.int64)

    @property
    def t_s(self) -> F64:
        """(N,) seconds since the first frame."""
        return (self.t_ns - self._t_ns[0]) / 1e9 if self._t_ns else np.zeros(0)

    @property
    def lead(self) -> I64:
        """(N,) id of each frame's CIPV, ``NONE`` without one."""
        return np.array(self._lead, np.int64)

    def sightings(self) -> SightingRecords:
        """(M,) ``SIGHTING`` records, by id, then by frame."""
        if not self._parts:
            return np.zeros(0, SIGHTING)
        found = np.concatenate(self._parts)
        return found[np.lexsort((found["frame"], found["id"]))]


def _sighting(frame: int, item: FusedObject) -> tuple[object, ...]:
    measured = item.distance_m is not None and not item.carried
    return (
        frame,
        item.id,
        measured and item.distance_from not in (None, "box"),
        measured and item.distance_from == "box" and not item.tracked_by_two_sensors,
        item.carried,
        item.tracked_by_two_sensors,
        item.in_path,
        _or_nan(item.distance_m),
        _or_nan(closing_speed_mps(item)),
    )


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value
