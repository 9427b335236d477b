"""Scenarios: YAML files that describe the road, the actors and their scripts, or OpenSCENARIO files. Errors in a file
are reported in one sentence."""

from __future__ import annotations

from functools import cached_property
from math import ceil, hypot, pi
from pathlib import Path
from typing import Any, Literal
from urllib.parse import parse_qsl

import numpy as np
from pydantic import Field, ValidationError, model_validator

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import first_complaint, given_path, parse_yaml, read_yaml
from pipeline.simulation.built_in import FOLDER, names
from pipeline.simulation.drawing.lens import ORDINARY, CameraModel
from pipeline.simulation.sensors.detection_model import Detections
from pipeline.simulation.sensors.faults import NONE, Faults
from pipeline.simulation.sensors.gnss_model import MEASURED, RTK, GnssModel, OdometryModel
from pipeline.simulation.sensors.lidar.model import VLP16, LidarModel
from pipeline.simulation.world.actors import Actor, Motion, Script, Speeds, motion
from pipeline.simulation.world.free_ways import FreeActor
from pipeline.simulation.world.intersection_ways import CrossingActor, CrossingWay, route
from pipeline.simulation.world.lines import RoadLine
from pipeline.simulation.world.roads import Road, ScenarioPart
from pipeline.types import F64
from pipeline.types.sensors import SensorKind, further_sensors

_GAP_STEP_S, _GAP_HALVINGS = 0.25, 10
_CLEAR_M, _ASIDE_M, _LONGEST_M = 1.0, 0.5, 2_000.0
"""Ways are kept clear in steps, that far beside whoever takes them, and so far along them."""


class ScenarioError(BadInput):
    """A scenario that does not exist or is invalid; the message says what is wrong."""


class Ego(Script):
    """The ego vehicle's own script."""

    start_m: float = 100.0
    """Position of its LiDAR along the road at time 0."""


DrivenMoment = tuple[float, float, float, float, float, float]
"""A ``Motion``: travelled_m, d_m, speed_mps, accel_mps2, d_rate_mps, d_accel_mps2."""


class Scenario(ScenarioPart):
    """One scenario file."""

    title: str
    """Display name."""
    seed: int = Field(default=0, ge=0)
    """Seed of all random values: equal seeds give equal bytes."""
    duration_s: float = Field(gt=0.0, le=3600.0)
    """Duration of the drive."""
    rate_hz: float = Field(default=10.0, ge=1.0, le=20.0)
    """Rate of the LiDAR's rotation, which is the tick rate."""
    road: Road
    """The road that all vehicles use."""
    lidar: LidarModel = VLP16
    """Mount and noise."""
    camera: CameraModel = ORDINARY
    """Lens and noise."""
    gnss: GnssModel = RTK
    """Position on the Earth and noise of the receiver."""
    odometry: OdometryModel = MEASURED
    """Noise of ego speed and yaw rate."""
    ego: Ego
    """The ego vehicle's script."""
    actors: tuple[Actor, ...] = ()
    """Road users along the road."""
    crossing_actors: tuple[CrossingActor, ...] = ()
    """Road users that come from a crossing's other arms."""
    free_actors: tuple[FreeActor, ...] = ()
    """Road users on ways of their own, such as pedestrians who cross."""
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Which of LiDAR and camera are available to the pipeline."""
    further_sensors: tuple[str, ...] = ()
    """Names of further ranging sensors that the car has (``pipeline.types.sensors``)."""
    detections: Detections | None = None
    """Simulated detections in the images; None to run the detectors."""
    faults: Faults = NONE
    """Faults of the sensors."""
    notes: tuple[str, ...] = ()
    """Sentences that are shown with the drive, such as what its source had that is not simulated."""
    driven: tuple[DrivenMoment, ...] = ()
    """The ego vehicle's motion from a closed-loop drive, one entry per tick; if given, it replaces the script."""

    @model_validator(mode="after")
    def _lanes_and_ids(self) -> Scenario:
        for script in (self.ego, *self.actors):
            for lane in (script.lane, *(change.lane for change in script.lane_changes)):
                self.road.lane_offset_m(lane)
        if self.ego.lane > 0:
            raise ValueError("the ego vehicle must drive along the road, on a lane below 0")
        elsewhere: tuple[CrossingActor | FreeActor, ...] = (*self.crossing_actors, *self.free_actors)
        scripts: tuple[Speeds, ...] = (self.ego, *elsewhere)
        if any(script.brake is not None and script.brake.at_s is None for script in scripts):
            raise ValueError("only vehicles on the ego vehicle's road can brake at_gap_m; give at_s")
        ids = [actor.id for actor in (*self.actors, *elsewhere)]
        if len(set(ids)) != len(ids):
            raise ValueError("two actors have the same id")
        for actor in self.crossing_actors:
            route(actor, self.road)
        self.further_kinds()
        return self

    def further_kinds(self) -> tuple[SensorKind, ...]:
        """The kinds of ``further_sensors``. ValueError for one that cannot be simulated."""
        known = {kind.name: kind for kind in further_sensors() if kind.simulator}
        for name in self.further_sensors:
            if name not in known:
                raise ValueError(f"no simulated sensor {name!r}; available: {', '.join(known) or 'none'}")
        return tuple(known[name] for name in self.further_sensors)

    def frame_count(self) -> int:
        return max(1, round(self.duration_s * self.rate_hz))

    def own_motion(self, t_s: float) -> Motion:
        """Motion of the ego vehicle at time t: as driven, interpolated between two ticks, else from its script."""
        if not self.driven:
            return motion(self.ego, self.road, t_s)
        at = min(max(t_s * self.rate_hz, 0.0), len(self.driven) - 1.0)
        before, share = int(at), at - int(at)
        after = min(before + 1, len(self.driven) - 1)
        pairs = zip(self.driven[before], self.driven[after], strict=True)
        return Motion(*(a + share * (b - a) if share > 1e-9 else a for a, b in pairs))

    @cached_property
    def cast(self) -> tuple[Actor, ...]:
        """The actors on the road, with every ``at_gap_m`` of a brake converted into the time at which it is reached."""
        return tuple(_timed(self, actor) for actor in self.actors)

    @cached_property
    def parked(self) -> tuple[tuple[Actor, ...], F64, F64]:
        """The actors that never move, their (N,) positions along the road, and (N, 3) their poses in the world."""
        still = tuple(each for each in self.cast if not any(each.speed_mps.values()) and not each.lane_changes)
        s_m = np.array([each.place_m(self.road, self.ego.start_m, 0.0) for each in still])
        d_m = np.array([self.road.lane_offset_m(each.lane) + each.offset_m for each in still])
        poses = self.road.to_world(s_m, d_m) if still else np.zeros((0, 3))
        poses[:, 2] += [pi if each.direction() < 0.0 else 0.0 for each in still]
        return still, s_m, poses

    @cached_property
    def driving(self) -> tuple[Actor, ...]:
        """The other actors on the road."""
        still = {each.id for each in self.parked[0]}
        return tuple(each for each in self.cast if each.id not in still)

    @cached_property
    def routes(self) -> tuple[CrossingWay, ...]:
        """The paths of ``crossing_actors``."""
        return tuple(route(actor, self.road) for actor in self.crossing_actors)

    @cached_property
    def free_ways(self) -> tuple[RoadLine, ...]:
        """The ways of ``free_actors`` in the world."""
        return tuple(actor.line(self.road) for actor in self.free_actors)

    @cached_property
    def kept_clear(self) -> F64 | None:
        """(M, 3) world x, y and radius of circles along the ways of ``free_actors`` in which nothing may stand; None
        without any."""
        circles = [
            np.column_stack([way.to_world(s_m, 0.0)[:, :2], np.full(len(s_m), hypot(*actor.size()[:2]) / 2 + _ASIDE_M)])
            for actor, way in zip(self.free_actors, self.free_ways, strict=True)
            for s_m in [np.arange(0.0, min(actor.travelled_m(self.duration_s), _LONGEST_M) + _CLEAR_M, _CLEAR_M)]
        ]
        return np.concatenate(circles) if circles else None

    def without_others(self) -> Scenario:
        """The same drive on an empty road."""
        return self.model_copy(update={"actors": (), "crossing_actors": (), "free_actors": ()})


def _timed(scenario: Scenario, actor: Actor) -> Actor:
    if actor.brake is None or actor.brake.at_gap_m is None:
        return actor
    wanted_m = actor.brake.at_gap_m
    steps = range(ceil(scenario.duration_s / _GAP_STEP_S) + 1)
    late_s = next((i * _GAP_STEP_S for i in steps if _gap_m(scenario, actor, i * _GAP_STEP_S) <= wanted_m), None)
    if late_s is None:
        return actor
    early_s = max(late_s - _GAP_STEP_S, 0.0)
    for _ in range(_GAP_HALVINGS):
        middle_s = (early_s + late_s) / 2
        early_s, late_s = (early_s, middle_s) if _gap_m(scenario, actor, middle_s) <= wanted_m else (middle_s, late_s)
    return actor.model_copy(update={"brake": actor.brake.model_copy(update={"at_s": late_s, "at_gap_m": None})})


def _gap_m(scenario: Scenario, actor: Actor, t_s: float) -> float:
    """From the ego origin to an actor's nearest face along the road, before it brakes."""
    road, ego = scenario.road, scenario.ego
    own_m = road.line.advance(ego.start_m, ego.travelled_m(t_s), road.lane_offset_m(ego.lane) + ego.offset_m)
    return actor.place_m(road, ego.start_m, actor.travelled_m(t_s)) - actor.size()[0] / 2 - own_m


def load(name_or_path: str) -> Scenario:
    """A built-in scenario by name, any file that ends in .yaml, or an OpenSCENARIO file that ends in .xosc; options may
    follow the latter: ``?variant=2`` or values of its parameters. ScenarioError says what is wrong."""
    file, _, options = name_or_path.partition("?")
    if file.lower().endswith(".xosc"):
        return _from_openscenario(given_path(file, ScenarioError), options)
    path = given_path(name_or_path, ScenarioError) if name_or_path.endswith((".yaml", ".yml")) else None
    if path is None:
        if Path(name_or_path).suffix or Path(name_or_path).name != name_or_path:
            raise ScenarioError(f"{name_or_path}: not a scenario file: its name must end in .yaml or .xosc")
        if name_or_path not in names():
            raise ScenarioError(f"no scenario named {name_or_path!r}; there are {', '.join(names())}")
        path = FOLDER / f"{name_or_path}.yaml"
    return _checked(read_yaml(path, path.name, ScenarioError), path.name)


def _from_openscenario(path: Path, options: str) -> Scenario:
    from pipeline.simulation.openscenario import OpenScenarioError, convert  # needed for these files only

    given = dict(parse_qsl(options, keep_blank_values=True))
    number, ego = given.pop("variant", None), given.pop("ego", None)
    if number is not None and not (number.isascii() and number.isdecimal() and len(number) < 10):
        raise ScenarioError(f"{path.name}: variant={number!r}: expected a number from 1")
    try:
        return _checked(convert(path, None if number is None else int(number), given, ego), path.name)
    except OpenScenarioError as error:
        raise ScenarioError(str(error)) from None


def parse(text: str, file: str) -> Scenario:
    """The scenario from a YAML text. ScenarioError names the file, the key and what is wrong with it."""
    return _checked(parse_yaml(text, file, ScenarioError), file)


def _checked(loaded: Any, file: str) -> Scenario:
    if not isinstance(loaded, dict):
        raise ScenarioError(f"{file}: expected keys such as title, road, ego and actors")
    try:
        return Scenario.model_validate(loaded)
    except ValidationError as error:
        raise ScenarioError(f"{file}: {first_complaint(error, Scenario)}") from None
