"""Scenarios for tests."""

from __future__ import annotations

from pipeline.simulation import scenario
from pipeline.simulation.scenario import Scenario


def with_actors(actors: str = "", segments: str = "{length_m: 2000}", lane: int = -2, speed: float = 20.0) -> Scenario:
    """A bare three-lane road with the ego car at constant speed."""
    text = f"""
title: test
duration_s: 10
road: {{segments: [{segments}]}}
ego: {{lane: {lane}, speed_mps: {{0: {speed}}}}}
actors: [{actors}]
"""
    return scenario.parse(text, "test.yaml")
