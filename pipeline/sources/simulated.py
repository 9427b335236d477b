"""``sim:<scenario>``: a drive through the simulator as a source, every frame made when asked for.

The ego frame's origin is the LiDAR, level in the front bumper 0.5 m above the road. A frame depends on the scenario
and its index alone, so the same index gives the same bytes in any order.
"""

from __future__ import annotations

import numpy as np

from pipeline.simulation import lidar, scenario, world
from pipeline.simulation.camera import DrawnCamera
from pipeline.simulation.roadside import Roadside
from pipeline.sources.base import SourceError, TruthObject
from pipeline.types import EgoState, Frame, Picture

_BEFORE_M, _BEYOND_M = 100.0, 600.0
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
        start_m, end_m = self._scenario.ego.start_m - _BEFORE_M, last.s_m + _BEYOND_M
        self._roadside = Roadside.build(self._scenario.road, self._scenario.seed, start_m, end_m)
        road, seed = self._scenario.road, self._scenario.seed
        self._camera = DrawnCamera(road, self._roadside, seed, self._scenario.camera)

    def __len__(self) -> int:
        return self._scenario.frame_count()

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return index * self._step_ns

    def frame(self, index: int) -> Frame:
        tick, now = self.t_ns(index), self._world(index)
        return Frame(
            index,
            f"{index:06d}",
            tick,
            sweep=lidar.sweep(now, self._roadside, self._scenario.seed, index, tick),
            picture=Picture(tick, self._camera.picture(now)),
            camera=self._camera.camera,
            ego=EgoState(tick, now.speed_mps, now.yaw_rate_radps),
        )

    def truth(self, index: int) -> tuple[TruthObject, ...]:
        """Every vehicle that is at least partly ahead of the LiDAR and within 120 m, hidden ones too."""
        self.t_ns(index)
        return tuple(
            TruthObject(state.actor.kind, state.cuboid, state.actor.id)
            for state in sorted(self._world(index).actors, key=lambda state: state.actor.id)
            if state.cuboid.footprint()[:, 0].max() > 0.0 and np.hypot(*state.cuboid.center[:2]) < _TRUTH_RANGE_M
        )

    def _world(self, index: int) -> world.World:
        return world.at(self._scenario, self.t_ns(index) / 1e9)
