"""Performance requirements for the stages, on an idle machine with two cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Requirement:
    """A limit on one figure of a stage."""

    stage: str
    """Name of its row in the bench's table."""
    figure: str
    """Key of the figure in the stage's row."""
    at_most: float | None = None
    """Upper limit; None without one."""
    at_least: float | None = None
    """Lower limit; None without one."""
    peer: str | None = None
    """The library that the figure compares with; None for a figure of the stage itself."""
    is_optional: bool = False
    """Whether it is skipped if the stage's recording is not available."""

    def broken(self, figures: Mapping[str, Mapping[str, Any]]) -> str | None:
        """A sentence when the figure misses its limit or was not measured; None otherwise, or when the peer is not
        installed."""
        if self.stage not in figures and self.is_optional:
            return None
        row = figures.get(self.stage, {})
        if self.peer is not None:
            row = row.get("peers", {}).get(self.peer, {})
        name = f"{self.stage}: {self.figure}{'' if self.peer is None else f' to {self.peer}'}"
        if self.figure not in row:
            return f"{name} was not measured"
        value = row[self.figure]
        if value is None:
            return None
        what = f"{name} is {value:.2f}"
        if self.at_most is not None and value > self.at_most:
            return f"{what}; required: at most {self.at_most:g}"
        if self.at_least is not None and value < self.at_least:
            return f"{what}; required: at least {self.at_least:g}"
        return None


def _faster(stage: str, peer: str, times: float) -> tuple[Requirement, Requirement]:
    """A stage must be ``times`` as fast as the peer, on both recordings that the LiDAR stages are measured on."""
    return (
        Requirement(stage, "ratio", at_least=times, peer=peer),
        Requirement(f"{stage}@kitti", "ratio", at_least=times, peer=peer, is_optional=True),
    )


DEMANDS = (
    *_faster("ground", "numpy", 30.0),
    *_faster("cluster", "open3d cluster_dbscan", 80.0),
    *_faster("lidar_chain", "open3d, 0.2 m voxels", 6.0),
    *_faster("lidar_chain", "open3d", 50.0),
    Requirement("decode", "median_ms", at_most=2.0),
    Requirement("step", "median_ms", at_most=5.0),
    Requirement("step_beside_network", "p99_to_idle_median", at_most=4.0),
    Requirement("line", "rate_hz", at_least=10.0),
    Requirement("simulate_lidar", "ratio", at_least=5.0, peer="real time"),
    Requirement("simulate_camera", "ratio", at_least=1.0, peer="real time"),
)


PAGE_DEMANDS = tuple(
    Requirement(f"{what}{when}", "median_ms", at_most=at_most)
    for when in ("", " while computed")
    for what, at_most in (("seek", 150.0), ("first view", 2000.0))
)
"""Requirements for the dashboard in a browser on the same machine."""


def page_rows(figures: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The figures of ``app.bench.page.measure`` as stages."""
    page, computed = figures["page"], figures["while_computed"]
    return {
        "seek": page["seek"],
        "first view": page["first_view"],
        "seek while computed": computed["seek"],
        "first view while computed": computed["first_view"],
    }


def broken(figures: Mapping[str, Mapping[str, Any]], demands: Sequence[Requirement] = DEMANDS) -> Iterator[str]:
    """Yield one sentence for each requirement that is missed."""
    return (sentence for demand in demands if (sentence := demand.broken(figures)) is not None)
