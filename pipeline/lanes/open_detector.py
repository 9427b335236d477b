"""Which lane detector looks at pictures: a network where one is named or installed, else the classical one."""

from __future__ import annotations

from dataclasses import replace

from pipeline.inference.runtime import find_graph
from pipeline.lanes.classical import NAME as CLASSICAL
from pipeline.lanes.classical import ClassicalLanes, open_classical
from pipeline.lanes.network import LaneNetwork, open_lane_network
from pipeline.types import CameraCalibration

OFF = "off"
_NETWORK_EVERY, _NETWORK_EVERY_S = 3, 0.3
"""A network takes longer than a frame on a processor; its lines are good for the time between by the car's motion, and
for no longer: of a slow recording it looks at more of the frames."""
LaneDetector = LaneNetwork | ClassicalLanes
_REMEDY = "; for real roads pull a network with `cipv models pull twinlitenet`"


def usual_every(lanes: object, rate_hz: float) -> int:
    """In every how many of ``rate_hz`` frames a second a lane detector looks at the picture where nobody says so."""
    if not isinstance(lanes, LaneNetwork):
        return 1
    return max(1, min(_NETWORK_EVERY, int(_NETWORK_EVERY_S * rate_hz + 1e-6)))


def open_lanes(spec: str | None, camera: CameraCalibration | None, drawn: bool = False) -> LaneDetector | None:
    """The named lane detector: a network's name or file, ``classical``, or ``off``, which is none. Without a name: the
    default network if one is here, except for drawn pictures, whose paint the classical one sees as well at a tenth of
    the cost. camera: of the pictures; null where it is not known.

    DetectorMissing when the named one is not here, DetectorError when it cannot be run.
    """
    if spec == OFF:
        return None
    if spec is not None and spec != CLASSICAL:
        return open_lane_network(spec)
    if spec is None and not drawn and find_graph(None, "lanes") is not None:
        return open_lane_network(None)
    classical = open_classical(camera)
    if spec is None and not drawn:
        return replace(classical, notes=tuple(note + _REMEDY for note in classical.notes))
    return classical
