"""How well a knocked camera is found in random traffic: drives of the robustness suite, the camera turned once.

    python -m tests.soak.drift --km 30 --seed 900 --at 35
    python -m tests.soak.drift --km 100 --seed 3000 --only exact

Each drive is ray-cast once; the boxes of each turned camera are made from the same truth, with a detector's measured
errors. A table says how often the turn is reported with the right angle (±0.35°, or 35 % of it) within 30 s in which at
least one vehicle is in plain sight within 40 m, in all drives within 30 s of driving, and how often something is
reported that is not so. ``as it is`` keeps
the suite's own errors of calibration, up to half a degree; the other rows begin with an exact one. ``late image``: from
that moment on, images are 100 ms late. ``LiDAR yaw``: the LiDAR is turned instead of the camera. ``--only`` limits the
rows: false reports alone need many kilometres, and no camera that turns.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pipeline.alignment.projection import resolve
from pipeline.common.fast_replace import evolve
from pipeline.common.stopwatch import Stopwatch
from pipeline.experiments.robustness import traffic
from pipeline.fusion.drift.follow import Drift, DriftState, Seen, follow
from pipeline.fusion.drift.lines import of_measured
from pipeline.fusion.ground_contact import road_ahead
from pipeline.lanes import road_lines as lanes
from pipeline.lidar import segmentation, tracking
from pipeline.params import Params
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import World
from pipeline.types import Frame, Ground, Moment, RawBoxes, VisionMeasurement
from pipeline.vision.nms import select

WITHIN_S, LONGEST_S = 30.0, 70.0
SIGHT_M, SIGHT_SHARE = 40.0, 0.8
TURNS: Mapping[str, tuple[float, float]] = {
    "as it is": (0.0, 0.0),
    "exact": (0.0, 0.0),
    "late image": (0.0, 0.0),
    "LiDAR yaw 2°": (2.0, 0.0),
    **{f"yaw {deg:g}°": (deg, 0.0) for deg in (0.5, 1.0, 2.0)},
    **{f"pitch {deg:g}°": (0.0, deg) for deg in (0.5, 1.0, 2.0)},
}
LATE_MS = 100.0


class Outcome(NamedTuple):
    """One variant of one drive."""

    found_after_s: float | None
    """Seconds of traffic from the knock to the first right report."""
    found_at_s: float | None
    """Time of the first right report."""
    has_lines: bool
    """Whether the road has lines that the camera sees."""
    traffic_s: float
    """Seconds of traffic after the knock."""
    wrong_at_s: float | None
    """Times of false reports."""
    wrong: Drift | None
    """Their texts."""


class Watch:
    """Follows one variant, and judges its reports."""

    def __init__(self, scene: Scenario, name: str, sign: float, knock_s: float) -> None:
        self._knock_s = knock_s
        yaw, pitch = (sign * angle for angle in TURNS[name])
        own = (scene.faults.camera_yaw_deg, scene.faults.camera_pitch_deg) if name == "as it is" else (0.0, 0.0)
        faults: dict[str, Any] = {"camera_yaw_deg": own[0], "camera_pitch_deg": own[1]}
        if yaw or pitch:
            faults["knock"] = {"at_s": knock_s, "yaw_deg": yaw, "pitch_deg": pitch}
        given = scene.faults.model_dump() | faults
        self._senses = Senses(scene.model_copy(update={"faults": type(scene.faults).model_validate(given)}))
        late = given | {"camera_skew_ms": float(np.copysign(LATE_MS, given["camera_skew_ms"]))}
        self._late = Senses(scene.model_copy(update={"faults": type(scene.faults).model_validate(late)}))
        exact = given | {"camera_yaw_deg": 0.0, "camera_pitch_deg": 0.0, "knock": None}
        self._lined = Senses(scene.model_copy(update={"faults": type(scene.faults).model_validate(exact)}))
        self._is_lidar, self._lanes = name.startswith("LiDAR"), lanes.LaneState()
        self._has_lines = scene.detections is not None and scene.detections.lines is not None
        self._is_late, self._own, self._turn = name == "late image", np.array(own), np.array([yaw, pitch])
        self._state, self._params = DriftState(), Params()
        self._found_s: float | None = None
        self._found_at_s: float | None = None
        self._wrong_s: float | None = None
        self._wrong: Drift | None = None

    def sensed(self, frame: Frame, now: World) -> Frame:
        """The frame with what the detectors see in it."""
        is_late = self._is_late and now.t_s >= self._knock_s
        found = (self._late if is_late else self._senses).sensed(frame, now)
        if self._is_lidar and self._has_lines:  # the LiDAR's turn moves boxes against clusters, but no lines
            found = evolve(found, raw_lanes=self._lined.sensed(frame, now).raw_lanes)
        return found

    def take(self, seen: Seen, frame: Frame, ground: Ground | None, dt_s: float | None, traffic_s: float) -> None:
        params, t_s = self._params, frame.t_ns / 1e9
        aligned, now = resolve(params.alignment, frame.camera), Moment(frame.t_ns, dt_s, frame.ego, frame.ego)
        view = lanes.RoadView(aligned, ground, frame.camera.road_z_m if frame.camera is not None else None)
        self._lanes, _ = lanes.follow(self._lanes, frame.raw_lanes, view, now, params.lanes)
        found, ego = self._lanes.measured, frame.ego
        if found is not None and ego is not None:
            seen = seen._replace(lines=of_measured(found.lines, found.pitch.rad, ego.speed_mps, ego.yaw_rate_radps))
        self._state, told = follow(self._state, seen, aligned, params.alignment, params.fusion)
        if told is None:
            return
        truth = self._own + (self._turn if t_s >= self._knock_s else 0.0)
        angles = np.array([told.yaw_deg, told.pitch_deg])
        axis = int(np.argmax(np.abs(angles)))
        is_right = abs(angles[axis] - truth[axis]) <= max(0.35, 0.35 * abs(truth[axis]))
        is_right &= bool(angles[axis] * truth[axis] > 0.0)
        if is_right and t_s >= self._knock_s and self._turn.any() and self._found_s is None:
            self._found_s, self._found_at_s = traffic_s, t_s
        elif not is_right and self._wrong_s is None:
            self._wrong_s, self._wrong = t_s, told

    def outcome(self, traffic_s: float) -> Outcome:
        return Outcome(
            found_after_s=self._found_s,
            found_at_s=self._found_at_s,
            has_lines=self._has_lines,
            traffic_s=traffic_s,
            wrong_at_s=self._wrong_s,
            wrong=self._wrong,
        )


def drive(seed: int, number: int, knock_s: float, names: Sequence[str]) -> tuple[float, dict[str, Outcome]]:
    """Kilometres driven, and the outcome of each of these variants. knock_s: when the camera turns."""
    scene = traffic.scenario(seed, number)
    scene = scene.model_copy(update={"duration_s": min(scene.duration_s, LONGEST_S)})
    rng, params = np.random.default_rng([seed, number]), Params()
    signs = {name: float(rng.choice((-1.0, 1.0))) for name in TURNS}  # the same, whichever are asked for
    watches = {name: Watch(scene, name, signs[name], knock_s) for name in names}
    rig = SensorRig(scene, world_state.at(scene, scene.duration_s).s_m)
    tracked, lidar, last_ns, traffic_s, step_ns = tracking.LidarTrackerState(), Senses(scene), None, 0.0, 100_000_000
    step_ns = round(1e9 / scene.rate_hz)
    for index in range(scene.frame_count()):
        now = world_state.at(scene, index * step_ns / 1e9)
        frame = rig.frame(now, index, index * step_ns, image=False)
        assert frame.sweep is not None
        dt_s = None if last_ns is None else (frame.t_ns - last_ns) / 1e9
        last_ns = frame.t_ns
        sweep = segmentation.segment(lidar.disturbed(frame.sweep, index), frame.ego, params, Stopwatch(), tracked, dt_s)
        tracked, tracks = tracking.track(tracked, sweep.obstacles, dt_s, params.lidar_tracking)
        speed_mps = frame.ego.speed_mps if frame.ego is not None else None
        aligned = resolve(params.alignment, rig.camera)
        camera = rig.camera
        plain = (
            each.visible > SIGHT_SHARE and np.hypot(*each.actor.cuboid.center[:2]) < SIGHT_M
            for each in in_image(now, camera)
        )
        traffic_s += any(plain) / scene.rate_hz if now.t_s >= knock_s else 0.0
        blind = evolve(frame, sweep=None)
        for watch in watches.values():
            found = watch.sensed(blind, now)
            boxes = _measured(found.raw_boxes, params) if found.raw_boxes is not None else None
            road = road_ahead(sweep.points, sweep.ground, boxes, aligned, speed_mps)
            seen = Seen(frame.t_ns, frame.name, tracks, boxes, road, (camera.width, camera.height))
            watch.take(seen, found, sweep.ground, dt_s, traffic_s)
    km = (now.s_m - scene.ego.start_m) / 1000.0
    return km, {name: watch.outcome(traffic_s) for name, watch in watches.items()}


def _measured(raw: RawBoxes, params: Params) -> tuple[VisionMeasurement, ...]:
    return tuple(VisionMeasurement(each, None, None, None) for each in select(raw, params.detection))


def drives(
    seed: int, km: float, knock_s: float, names: Sequence[str]
) -> Iterator[tuple[int, float, dict[str, Outcome]]]:
    """As many drives as needed for this number of kilometres."""
    whole, number = 0.0, 0
    while whole < km:
        driven, outcomes = drive(seed, number, knock_s, names)
        whole += driven
        yield number, driven, outcomes
        number += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--km", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=900)
    parser.add_argument("--at", type=float, default=35.0, help="seconds after which the camera turns")
    parser.add_argument("--only", nargs="+", choices=list(TURNS), default=list(TURNS), metavar="ROW")
    asked = parser.parse_args()
    rows: dict[str, list[Outcome]] = {name: [] for name in asked.only}
    whole_km = 0.0
    for number, km, outcomes in drives(asked.seed, asked.km, asked.at, asked.only):
        whole_km += km
        for name, each in outcomes.items():
            rows[name].append(each)
            if each.wrong is not None:
                print(f"drive {number}, {name}: at {each.wrong_at_s:.1f} s {each.wrong.note}", flush=True)
    print(f"{whole_km:.1f} km")
    for name, found in rows.items():
        enough = [each for each in found if each.traffic_s >= WITHIN_S]
        right = [each.found_after_s for each in enough if (each.found_after_s or np.inf) <= WITHIN_S]
        median = f", median after {np.median(right):.0f} s" if right else ""  # type: ignore[arg-type]
        wrong = sum(each.wrong is not None for each in found)
        soon = [each for each in found if (each.found_at_s or np.inf) <= asked.at + WITHIN_S]
        lined = sum(each.has_lines for each in soon), sum(each.has_lines for each in found)
        driving = f"within {WITHIN_S:g} s of driving in {len(soon)} of {len(found)}"
        print(
            f"{name}: found in {len(right)} of {len(enough)}{median}; {driving}, with lines in {lined[0]} of "
            f"{lined[1]}; wrong reports in {wrong} of {len(found)} drives",
            flush=True,
        )


if __name__ == "__main__":
    main()
