"""Runs the sensors of a scenario without rendering images, for suites that drive very many kilometres."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import World
from pipeline.types import Frame


def frames(scenario: Scenario) -> Iterator[tuple[World, Frame]]:
    """The truth and the sensor data, tick by tick: the same as from ``sim:`` except for the images."""
    end_m = world_state.at(scenario, scenario.duration_s).s_m
    sensors, senses = SensorRig(scenario, end_m), Senses(scenario)
    step_ns = round(1e9 / scenario.rate_hz)
    for index in range(scenario.frame_count()):
        now = world_state.at(scenario, index * step_ns / 1e9)
        yield now, senses.sensed(sensors.frame(now, index, index * step_ns, image=False), now)
