"""``sim:<scenario>``: a simulated drive as a source, each frame computed on demand.

The ego frame's origin is the LiDAR, level in the front bumper 0.5 m above the road. A frame depends only on the
scenario and its index, so the same index gives the same bytes in any order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.simulation import scenario
from pipeline.simulation.sensors.faults import NONE
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roads import Road
from pipeline.sources.driven_way import placed_beside
from pipeline.types import Frame, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_TRUTH_RANGE_M, _WAY_STEP_M = 120.0, 1.0
_CALLED = {"pedestrian": "person"}
"""Kinds of actors whose labels have another name, as those of real recordings do."""


def open_recording(uri: str, rest: str, how: Opening) -> SimulatedSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return SimulatedSource(uri, rest)


class SimulatedSource:
    """The frames of one scenario."""

    is_simulated = True

    def __init__(self, uri: str, name: str) -> None:
        try:
            self._scenario = scenario.load(name)
        except scenario.ScenarioError as error:
            raise SourceError(str(error)) from None
        self.uri, self.title, self.rate_hz = uri, self._scenario.title, self._scenario.rate_hz
        self.notes = tuple(_notes(self._scenario))
        self._step_ns = round(1e9 / self.rate_hz)
        last = world_state.at(self._scenario, self._scenario.duration_s)
        self._sensors = SensorRig(self._scenario, last.s_m)
        self._senses = Senses(self._scenario)

    def __len__(self) -> int:
        return self._scenario.frame_count()

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return index * self._step_ns

    def frame(self, index: int) -> Frame:
        now = self._world(index)
        exposure = self._senses.exposure(now, index, self._sensors.camera)
        seen = self._sensors.frame(now, index, self.t_ns(index), image=exposure is not None, exposure=exposure)
        return self._senses.sensed(seen, now)

    def outlines(self) -> Iterator[Frame]:
        for index in range(len(self)):
            now = self._world(index)
            yield self._senses.sensed(self._sensors.outline(now, index, self.t_ns(index)), now)

    def sweep(self, index: int) -> Sweep | None:
        if self._scenario.sensors == "camera":
            return None
        return self._senses.disturbed(self._sensors.sweep(self._world(index), index, self.t_ns(index)), index)

    def truth(self, index: int) -> tuple[TruthObject, ...]:
        self.t_ns(index)
        return truth_of(self._world(index), self._scenario.road)

    def _world(self, index: int) -> world_state.World:
        return world_state.at(self._scenario, self.t_ns(index) / 1e9)


def _notes(scene: scenario.Scenario) -> Iterator[str]:
    yield from scene.notes
    if scene.sensors == "lidar":
        yield "This drive uses the LiDAR alone; its images are shown but not analysed."
        return
    if scene.sensors == "camera":
        yield "This drive uses the camera alone; it has no LiDAR."
    if scene.detections is not None:
        yield "Detections come with this drive: ground truth with a detector's errors. No network runs."
    if scene.faults != NONE:
        yield "The sensors of this drive have faults: see `faults` in its file."


def truth_of(now: world_state.World, road: Road) -> tuple[TruthObject, ...]:
    """Every road user that is at least partly ahead of the LiDAR and within 120 m, including hidden ones. The way of
    the car is parallel to the road."""
    ahead_m = now.s_m + np.arange(0.0, _TRUTH_RANGE_M + _WAY_STEP_M, _WAY_STEP_M)
    found = tuple(
        TruthObject(_CALLED.get(state.actor.kind, state.actor.kind), state.cuboid, state.actor.id)
        for state in sorted(now.actors, key=lambda state: state.actor.id)
        if state.cuboid.footprint()[:, 0].max() > 0.0 and np.hypot(*state.cuboid.center[:2]) < _TRUTH_RANGE_M
    )
    return placed_beside(now.to_ego(road.to_world(ahead_m, now.d_m)), found)
