"""The pipeline's view of the sensors: a scenario's faults, its detections, and the sensors in use.

Recorded scenarios and suites without images both use this module, so a suite's drive has the same frames when it is
opened again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.detection_model import Detections
from pipeline.simulation.sensors.faults import NONE, disturb_sweep, nods_rad, true_camera
from pipeline.simulation.sensors.real_detector import RealDetector
from pipeline.simulation.sensors.rig import Exposure
from pipeline.simulation.sensors.truth_lanes import lane_points
from pipeline.simulation.world import world_state
from pipeline.simulation.world.actors import Motion
from pipeline.simulation.world.world_state import World
from pipeline.types import CameraCalibration, Frame, Sweep


class Senses:
    """Simulated sensing of one scenario. The same frame and world give the same result, in any order."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._faults = scenario.faults
        self.seed = scenario.seed
        """Of all random numbers of the drive."""

    def sensed(self, frame: Frame, now: World) -> Frame:
        """The frame as sensed by the scenario's car, with the scenario's detections. The image stays even if it is not
        processed, so that it can be displayed."""
        scene = self._scenario
        if self._faults != NONE and frame.sweep is not None:
            frame = evolve(frame, sweep=self.disturbed(frame.sweep, frame.index))
        if scene.sensors == "lidar":
            return evolve(frame, detections_given=True)
        frame = evolve(frame, sweep=None) if scene.sensors == "camera" else frame
        if scene.detections is None or frame.camera is None:
            return frame
        return self._detected(evolve(frame, detections_given=True), now, scene.detections)

    def disturbed(self, sweep: Sweep, index: int) -> Sweep | None:
        """A sweep with the scenario's faults; None if it is lost."""
        if self._faults == NONE:
            return sweep
        return disturb_sweep(sweep, self._faults, self._scenario.seed, index, self._nod_rad(index))

    def exposure(
        self, now: World, index: int, camera: CameraCalibration, moving: Callable[[float], Motion] | None = None
    ) -> Exposure | None:
        """What the image of this frame shows, with the scenario's faults; None if it is lost. camera: its calibration.
        moving: the ego vehicle's motion at a time in seconds close to now; None if it follows the scenario."""
        scene, faults = self._scenario, self._faults
        if faults == NONE:
            return Exposure(now, camera)
        if np.random.default_rng([scene.seed, 22, index]).random() < faults.pictures_lost:
            return None
        camera = true_camera(camera, faults, self._nod_rad(index), now.t_s)
        if faults.camera_skew_ms:
            t_s = max(now.t_s + faults.camera_skew_ms / 1e3, 0.0)
            now = world_state.at(scene, t_s, moving(t_s) if moving is not None else None)
        return Exposure(now, camera)

    def _detected(self, frame: Frame, now: World, noise: Detections) -> Frame:
        scene, seed, index = self._scenario, self._scenario.seed, frame.index
        assert frame.camera is not None
        exposure = self.exposure(now, index, frame.camera)
        if exposure is None:
            return frame
        now, camera = exposure
        boxes = None
        if noise.measured:
            boxes = self._detector.boxes(now, camera, index)
        elif noise.boxes is not None:
            boxes = truth_boxes.boxes(now, camera, noise.boxes, seed, index)
        lanes = lane_points(now, scene.road, camera, noise.lines, seed, index) if noise.lines else None
        return evolve(frame, raw_boxes=boxes, raw_lanes=lanes)

    def _nod_rad(self, index: int) -> float:
        return float(self._nods[min(index, len(self._nods) - 1)]) if self._faults.nods_deg else 0.0

    @cached_property
    def _nods(self) -> np.ndarray:
        scene = self._scenario
        return nods_rad(self._faults, scene.seed, scene.frame_count(), scene.rate_hz)

    @cached_property
    def _detector(self) -> RealDetector:
        return RealDetector(self._scenario)
