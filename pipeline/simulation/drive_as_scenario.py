"""Saves a closed-loop drive as a scenario file: the same road and actors, with the ego vehicle's actual motion.

Sensor data is not stored, because it follows from the scenario, the motion and the seed, bit for bit. A drive therefore
takes only a few kilobytes, opens as ``sim:<file>`` wherever a scenario does, with ground truth, and has images even if
the loop rendered none.
"""

from __future__ import annotations

from collections.abc import Sequence

import yaml

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import Motion


def as_driven(scenario: Scenario, motions: Sequence[Motion], title: str | None = None) -> Scenario:
    """The scenario with the drive's duration, and the ego vehicle moving as in ``motions``, one per tick."""
    moments = tuple((m.travelled_m, m.d_m, m.speed_mps, m.accel_mps2, m.d_rate_mps, m.d_accel_mps2) for m in motions)
    return scenario.model_copy(
        update={
            "driven": moments,
            "duration_s": len(moments) / scenario.rate_hz,
            "actors": scenario.cast,  # the gap at which an actor brakes was reached at a certain time, which is kept
            "title": title or scenario.title,
        }
    )


def to_yaml(scenario: Scenario, heading: str = "") -> str:
    """The scenario as a file for ``pipeline.simulation.scenario.load``, without default values. heading: comment lines
    at the top."""
    comment = "".join(f"# {line}\n" for line in heading.splitlines())
    return comment + yaml.safe_dump(
        scenario.model_dump(mode="json", exclude_defaults=True),
        sort_keys=False,
        width=120,
        allow_unicode=True,
        default_flow_style=None,
    )
