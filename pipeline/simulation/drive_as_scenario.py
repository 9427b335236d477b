"""A closed-loop drive kept as a scenario file: the same road and actors, and the ego vehicle as it was driven.

What the sensors saw is not stored; it follows from the scenario, the motion and the seed, bit for bit. So a drive is a
few kilobytes, opens as ``sim:<file>`` wherever a scenario does, with truth, and gives pictures even where the loop drew
none.
"""

from __future__ import annotations

from collections.abc import Sequence

import yaml

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import Motion


def as_driven(scenario: Scenario, motions: Sequence[Motion], title: str | None = None) -> Scenario:
    """The scenario, as long as the drive, with the ego vehicle moving as ``motions`` say, one a tick."""
    moments = tuple((m.travelled_m, m.d_m, m.speed_mps, m.accel_mps2, m.d_rate_mps, m.d_accel_mps2) for m in motions)
    return scenario.model_copy(
        update={
            "driven": moments,
            "duration_s": len(moments) / scenario.rate_hz,
            "actors": scenario.cast,  # a gap at which one brakes was reached at a time, which stays
            "title": title or scenario.title,
        }
    )


def to_yaml(scenario: Scenario, heading: str = "") -> str:
    """The scenario as a file that ``pipeline.simulation.scenario.load`` takes back, without what is default.
    heading: lines for a person, put before it."""
    comment = "".join(f"# {line}\n" for line in heading.splitlines())
    return comment + yaml.safe_dump(
        scenario.model_dump(mode="json", exclude_defaults=True),
        sort_keys=False,
        width=120,
        allow_unicode=True,
        default_flow_style=None,
    )
