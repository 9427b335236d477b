"""What the stages must reach, on a machine of two cores that does nothing else: the one place that says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Demand:
    """A figure of a stage, with ``peer`` of it against that one: at most, or at least, so much. is_optional: its
    recording need not be here."""

    stage: str
    figure: str
    at_most: float | None = None
    at_least: float | None = None
    peer: str | None = None
    is_optional: bool = False

    def broken(self, figures: Mapping[str, Mapping[str, Any]]) -> str | None:
        """A sentence when it does not hold, or nobody measured it; None when it does. A peer that is not installed
        says nothing."""
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
            return f"{what}, wanted at most {self.at_most:g}"
        if self.at_least is not None and value < self.at_least:
            return f"{what}, wanted at least {self.at_least:g}"
        return None


def _faster(stage: str, peer: str, times: float) -> tuple[Demand, Demand]:
    """On both recordings that the LiDAR's stages are measured on."""
    return (
        Demand(stage, "ratio", at_least=times, peer=peer),
        Demand(f"{stage}@kitti", "ratio", at_least=times, peer=peer, is_optional=True),
    )


DEMANDS = (
    *_faster("ground", "numpy", 30.0),
    *_faster("cluster", "open3d cluster_dbscan", 80.0),
    *_faster("lidar_chain", "open3d, 0.2 m voxels", 6.0),
    *_faster("lidar_chain", "open3d", 50.0),
    Demand("decode", "median_ms", at_most=2.0),
    Demand("step", "median_ms", at_most=5.0),
    Demand("step_beside_network", "p99_to_idle_median", at_most=4.0),
    Demand("line", "rate_hz", at_least=10.0),
    Demand("simulate_lidar", "ratio", at_least=5.0, peer="real time"),
    Demand("simulate_camera", "ratio", at_least=1.0, peer="real time"),
)


PAGE_DEMANDS = tuple(
    Demand(f"{what}{when}", "median_ms", at_most=at_most)
    for when in ("", " while computed")
    for what, at_most in (("seek", 150.0), ("first view", 2000.0))
)
"""Of the page in a browser that runs beside the server."""


def page_rows(figures: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """What ``app.bench.page.figures`` gives, as stages."""
    page, computed = figures["page"], figures["while_computed"]
    return {
        "seek": page["seek"],
        "first view": page["first_view"],
        "seek while computed": computed["seek"],
        "first view while computed": computed["first_view"],
    }


def broken(figures: Mapping[str, Mapping[str, Any]], demands: Sequence[Demand] = DEMANDS) -> Iterator[str]:
    """A sentence for each demand that does not hold."""
    return (sentence for demand in demands if (sentence := demand.broken(figures)) is not None)
