"""``sim:<scenario>``: a drive through the simulator as a source, every frame made when asked for.

The ego frame's origin is the LiDAR, level in the front bumper 0.5 m above the road. A frame depends on the scenario
and its index alone, so the same index gives the same bytes in any order.
"""

from __future__ import annotations

import numpy as np

from pipeline.simulation import scenario, world
from pipeline.simulation.sensors import Sensors
from pipeline.sources.base import SourceError, TruthObject
from pipeline.types import Frame

_TRUTH_RANGE_M = 120.0


class SimulatedSource:
    """The frames of one scenario. notes: none, nothing is missing in a simulated drive."""

    def __init__(self, uri: str, name: str) -> None:
        try:
            self._scenario = scenario.load(name)
        except scenario.ScenarioError as error:
            raise SourceError(f"{uri}: {error}") from None
        self.uri, self.title, self.rate_hz = uri, self._scenario.title, self._scenario.rate_hz
        self.notes: tuple[str, ...] = ()
        self._step_ns = round(1e9 / self.rate_hz)
        last = world.at(self._scenario, self._scenario.duration_s)
        self._sensors = Sensors(self._scenario, last.s_m)

    def __len__(self) -> int:
        return self._scenario.frame_count()

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return index * self._step_ns

    def frame(self, index: int) -> Frame:
        return self._sensors.frame(self._world(index), index, self.t_ns(index))

    def truth(self, index: int) -> tuple[TruthObject, ...]:
        self.t_ns(index)
        return truth_of(self._world(index))

    def _world(self, index: int) -> world.World:
        return world.at(self._scenario, self.t_ns(index) / 1e9)


def truth_of(now: world.World) -> tuple[TruthObject, ...]:
    """Every vehicle that is at least partly ahead of the LiDAR and within 120 m, hidden ones too."""
    return tuple(
        TruthObject(state.actor.kind, state.cuboid, state.actor.id)
        for state in sorted(now.actors, key=lambda state: state.actor.id)
        if state.cuboid.footprint()[:, 0].max() > 0.0 and np.hypot(*state.cuboid.center[:2]) < _TRUTH_RANGE_M
    )
