"""Chooses the lane detector: a network if one is named or installed, otherwise the classical one."""

from __future__ import annotations

from dataclasses import replace

from pipeline.inference.runtime import find_graph
from pipeline.lanes.classical import NAME as CLASSICAL
from pipeline.lanes.classical import ClassicalLanes, open_classical
from pipeline.lanes.network import LaneNetwork, open_lane_network
from pipeline.types import CameraCalibration

OFF = "off"
_NETWORK_EVERY, _NETWORK_EVERY_S = 3, 0.3
"""On a CPU, a network takes longer than a frame interval. In between, its lines are moved by own motion, but no longer
than this time: at low frame rates it runs on more of the frames."""
LaneDetector = LaneNetwork | ClassicalLanes
_REMEDY = "; for real roads pull a network with `cipv models pull twinlitenet`"


def usual_every(lanes: object, rate_hz: float) -> int:
    """The default of ``Detectors.lanes_every`` at ``rate_hz`` frames per second: a lane detector runs on every n-th
    frame."""
    if not isinstance(lanes, LaneNetwork):
        return 1
    return max(1, min(_NETWORK_EVERY, int(_NETWORK_EVERY_S * rate_hz + 1e-6)))


def open_lanes(spec: str | None, camera: CameraCalibration | None, drawn: bool = False) -> LaneDetector | None:
    """The named lane detector: a network's name or file, ``classical``, or ``off`` for none. Without a name: the
    default network if it is installed, except for rendered images, in which the classical one finds the paint as well
    at a tenth of the cost. camera: camera of the images; None if it is not known.

    DetectorMissing if the named one is not installed, DetectorError if it cannot be run.
    """
    if spec == OFF:
        return None
    if spec is not None and spec != CLASSICAL:
        return open_lane_network(spec, camera=camera)
    if spec is None and not drawn and find_graph(None, "lanes") is not None:
        return open_lane_network(None, camera=camera)
    classical = open_classical(camera)
    if spec is None and not drawn:
        return replace(classical, notes=tuple(note + _REMEDY for note in classical.notes))
    return classical
