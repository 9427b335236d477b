"""The ego vehicle's sensors in one scenario: any moment of the world as a ``Frame`` for the pipeline. Recorded drives
and closed loops both use it, so both see the same.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import gnss
from pipeline.simulation.sensors.camera import DrawnCamera, calibration
from pipeline.simulation.sensors.faults import most_turned_rad
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.simulation.sensors.planned_route import planned_route
from pipeline.simulation.world.roadside import Roadside
from pipeline.simulation.world.world_state import World
from pipeline.types import CameraCalibration, CameraImage, EgoState, Frame, RangeScan, Route, Sweep

_BEFORE_M, _BEYOND_M = 100.0, 600.0


class Simulator(Protocol):
    """Computes the scan of a further ranging sensor: the function that ``SensorKind.simulator`` names."""

    def __call__(self, now: World, seed: int, index: int, t_ns: int) -> RangeScan:
        """The scan of frame ``index``; the same arguments give the same scan."""
        ...


class Exposure(NamedTuple):
    """What an image shows."""

    world: World
    """The world at the time of exposure."""
    camera: CameraCalibration
    """The camera as it really looks."""


class SensorRig:
    """LiDAR, camera, speedometer, GNSS and the scenario's further sensors. end_m: the farthest position of the ego
    vehicle along the road; the roadside ends 600 m beyond. The same world and index give the same frame."""

    def __init__(self, scenario: Scenario, end_m: float) -> None:
        self._scenario = scenario
        self._lidar = Lidar(scenario.lidar)
        self._roadside = Roadside.build(
            scenario.road, scenario.seed, scenario.ego.start_m - _BEFORE_M, end_m + _BEYOND_M, scenario.kept_clear
        )

    def frame(self, now: World, index: int, t_ns: int, image: bool = True, exposure: Exposure | None = None) -> Frame:
        """What the sensors deliver at one tick. image: render the camera's image; without it the frame is made ten
        times faster and still has the camera calibration. exposure: when and where the camera really looks; None if now
        and as calibrated."""
        seen = exposure or Exposure(now, self.camera)
        return evolve(
            self.outline(now, index, t_ns),
            sweep=self.sweep(now, index, t_ns),
            image=CameraImage(t_ns, self._camera.image(*seen)) if image else None,
            route=self._route,
            scans={
                kind.name: kind.simulate(now, self._scenario.seed, index, t_ns)
                for kind in self._scenario.further_kinds()
            },
        )

    def outline(self, now: World, index: int, t_ns: int) -> Frame:
        """The same without sweep, image and route, which take almost all the time."""
        return Frame(
            index,
            f"{index:06d}",
            t_ns,
            camera=self.camera,
            ego=self._odometry(now, index, t_ns),
            gnss=gnss.fix(now, self._scenario.gnss, self._scenario.seed, index, t_ns),
        )

    def sweep(self, now: World, index: int, t_ns: int) -> Sweep:
        """Only the LiDAR's sweep."""
        return self._lidar.sweep(now, self._roadside, self._scenario.seed, index, t_ns)

    def _odometry(self, now: World, index: int, t_ns: int) -> EgoState:
        model = self._scenario.odometry
        noise = np.random.default_rng([self._scenario.seed, 9, index]).standard_normal(2)
        speed_mps = now.speed_mps + model.sigma_speed_mps * float(noise[0]) if now.speed_mps > 0.0 else 0.0
        turning = model.bias_yaw_rate_radps + model.sigma_yaw_rate_radps * float(noise[1])
        return EgoState(t_ns, max(speed_mps, 0.0), now.yaw_rate_radps + turning)

    @cached_property
    def _route(self) -> Route:
        return planned_route(self._scenario)

    @cached_property
    def camera(self) -> CameraCalibration:
        return calibration(self._scenario.camera)

    @cached_property
    def _camera(self) -> DrawnCamera:
        scene = self._scenario
        return DrawnCamera(scene.road, self._roadside, scene.seed, scene.camera, most_turned_rad(scene.faults))
