"""OpenSCENARIO files, their roads and their parameter values."""

from __future__ import annotations

from pathlib import Path

from pipeline.simulation import scenario
from tests.fuzz.file_targets import by_file
from tests.fuzz.target import Target
from tests.pipeline.simulation.openscenario.files import (
    BEND,
    Parts,
    at_time,
    condition,
    declared,
    event,
    lane_action,
    speed_action,
    story,
)


def scenario_targets(folder: Path) -> dict[str, Target]:
    """All targets of this module. Their files are written below ``folder``, which is created."""
    folder.mkdir()
    whole = Parts(
        parameters=declared("v", "20") + declared("w", "${$v/2+min(1, 2)}"),
        stories=story(
            event("brake", speed_action("$w", "linear", 3.0), condition(at_time(1.0))),
            event("turn", lane_action('<AbsoluteTargetLane value="-2"/>'), condition(at_time(2.0), 1.0, "rising")),
        ),
    )
    path = whole.write(folder)
    values = (
        '<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="drive.xosc"/><Deterministic>'
        '<DeterministicSingleParameterDistribution parameterName="v"><DistributionRange stepWidth="5">'
        '<Range lowerLimit="20" upperLimit="20"/></DistributionRange></DeterministicSingleParameterDistribution>'
        "</Deterministic></ParameterValueDistribution></OpenSCENARIO>"
    )
    kept = folder / "kept"
    kept.mkdir()
    beside = whole.write(kept)
    return {
        "openscenario": Target((path.read_bytes(),), by_file(folder, path.name, scenario.load)),
        "opendrive": Target(
            (whole.road.encode(), BEND.encode()), by_file(kept, "road.xodr", lambda _: scenario.load(str(beside)))
        ),
        "parameter values": Target((values.encode(),), by_file(kept, "values.xosc", scenario.load)),
    }
