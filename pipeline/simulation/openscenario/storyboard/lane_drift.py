"""Notices where lanes do not run parallel to the way: a vehicle that the simulator keeps at its offset would leave its
lane there."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, shown

_EVERY_S = 0.5
_MOST_M = 0.3
"""A sixth of the room that a car has in its lane; more could change whose path it is in."""


class LaneShift(OpenScenarioError):
    """A lane has shifted sideways under a vehicle."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(text)
        self.name = name
        """Of the vehicle."""


@dataclass
class LaneDrift:
    """The offset of every vehicle from the nearest lane since its last lane change."""

    _kept: dict[str, tuple[int, float]] = field(default_factory=dict)
    _next_s: float = 0.0

    def check(self, stage: PlayedScenario) -> None:
        """LaneShift if a lane has shifted sideways under a vehicle."""
        if stage.t_s < self._next_s - 1e-9:
            return
        self._next_s = stage.t_s + _EVERY_S
        for name, mover in stage.movers.items():
            if mover.line is not None or mover.body.kind == "pedestrian":
                continue
            s_m, now = mover.now(stage.t_s)
            if now.d_rate_mps != 0.0 or not 0.0 <= s_m <= mover.road.length_m:
                self._kept.pop(name, None)
                continue
            lanes = mover.road.lanes_at(s_m)
            lane = min(lanes, key=lambda each: abs(lanes[each] - now.d_m), default=None)
            if lane is None:
                continue
            offset_m = now.d_m - lanes[lane]
            version, before_m = self._kept.setdefault(name, (mover.lane_version, offset_m))
            if version != mover.lane_version:
                self._kept[name] = mover.lane_version, offset_m
            elif abs(offset_m - before_m) > _MOST_M:
                track = mover.road.track_at(s_m)
                raise LaneShift(
                    name,
                    f"{track.road.at.file}, line {track.road.at.line}: the lanes of road {shown(track.road.id)} shift "
                    f"sideways by {abs(offset_m - before_m):.1f} m at s = {track.road_m(s_m):.0f} m, where "
                    f"{shown(name)} drives; a lane onto which a vehicle changes must run parallel to the one before",
                )
