"""Own motion, and the path that it predicts, by what is known of the car's motion.

    python -m tests.soak.own_motion

The drive of ``CIPV_DATA`` is copied with and without ``oxts``, and each copy is opened and processed as a user would.
Speed and yaw rate are compared with the inertial unit's, and the path 30 m ahead with the way then driven, in all
frames that still have 30 m to drive. The second table has the mean error of the path on the simulator's curves.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.common.files.data_dir import data_dir
from pipeline.detection import Detectors, camera_of, detect, far_lanes_for, lanes_for
from pipeline.experiments.curves import scenarios
from pipeline.experiments.curves.drives import driven
from pipeline.lanes.open_detector import usual_every
from pipeline.params import Params, with_changes
from pipeline.path.corridor import offset
from pipeline.run import through
from pipeline.sources import open_source
from pipeline.types import F64, EgoState, Frame, Result

LOOK_AHEAD_M = 30.0
_DAY = "kitti_0009/2011_09_26"
_ALONE = {"path.use_edges": False, "path.use_traffic": False}


class Setup(NamedTuple):
    """One row of the table."""

    has_oxts: bool
    """Whether the copy has the inertial unit's files."""
    lanes: bool
    """Whether the network for lane lines runs, on every image."""
    changes: Mapping[str, object]
    """Of the parameters."""


SETUPS: Mapping[str, Setup] = {
    "INS": Setup(True, False, _ALONE),
    "LiDAR": Setup(False, False, _ALONE),
    "none": Setup(False, False, {"motion.source": "off", **_ALONE}),
    "lane lines only": Setup(False, True, {"motion.source": "off", "path.use_drivable": False, **_ALONE}),
    "drivable area only": Setup(False, True, {"motion.source": "off", "path.use_lanes": False, **_ALONE}),
    "LiDAR and drivable area": Setup(False, True, {"path.use_lanes": False, **_ALONE}),
    "INS and edges": Setup(True, False, {}),
    "LiDAR and edges": Setup(False, False, {}),
    "all of a copy with `oxts`": Setup(True, True, {}),
    "all of a copy without `oxts`": Setup(False, True, {}),
}


_CURVES = {**_ALONE, "path.use_gnss": False}
CURVE_SETUPS: Mapping[str, Mapping[str, object]] = {
    "CAN": {**_CURVES, "path.use_lanes": False, "motion.source": "can"},
    "LiDAR": {**_CURVES, "path.use_lanes": False, "motion.source": "lidar"},
    "none": {**_CURVES, "path.use_lanes": False, "motion.source": "off"},
    "lane lines only": {**_CURVES, "motion.source": "off"},
    "LiDAR, edges and vehicles": {"path.use_gnss": False, "path.use_lanes": False, "motion.source": "lidar"},
    "LiDAR and lane lines": {**_CURVES, "motion.source": "lidar"},
}


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        copies = {has: _copied(Path(folder) / str(has), has) for has in (True, False)}
        frames = {has: _frames(copy, has) for has, copy in copies.items()}
        own = [frame.ego for frame in frames[True] if frame.ego is not None]
        poses = poses_of([frame.t_ns for frame in frames[True]], own)
        print("| path by | speed, m/s | yaw rate, °/s | path at 30 m: mean, largest | sigma |")
        print("|---|---|---|---|---|")
        for name, setup in SETUPS.items():
            results = list(_results(frames[setup.has_oxts], setup))
            print(f"| {name} | {' | '.join(_cells(results, own, poses))} |", flush=True)
    print("\n| path by | R = 125 m | R = 250 m | S-curve | straight |\n|---|---|---|---|---|")
    errors = [_curve_errors_m(layout) for layout in ("r125", "r250", "s125", "straight")]
    for name in CURVE_SETUPS:
        print(f"| {name} | {' | '.join(each[name] for each in errors)} |")
    return 0


def _curve_errors_m(layout: str) -> dict[str, str]:
    """The mean error of the path 30 m ahead on one of the roads, by setup."""
    road = scenarios.LAYOUTS[layout]
    drives = driven(scenarios.scenario(road, 0), road.reach_m, tuple(CURVE_SETUPS), None, CURVE_SETUPS)
    return {name: f"{np.nanmean(np.abs([row[1] for row in drive.errors_m])):.2f}" for name, drive in drives.items()}


def poses_of(t_ns: list[int], own: list[EgoState]) -> F64:
    """(N, 3) x, y, heading of each frame, from the inertial unit's speed and yaw rate."""
    poses = np.zeros((len(own), 3))
    for k in range(1, len(own)):
        dt_s = (t_ns[k] - t_ns[k - 1]) / 1e9
        turned = 0.5 * ((own[k].yaw_rate_radps or 0.0) + (own[k - 1].yaw_rate_radps or 0.0)) * dt_s
        moved = 0.5 * (own[k].speed_mps + own[k - 1].speed_mps) * dt_s
        heading = poses[k - 1, 2] + 0.5 * turned
        poses[k] = poses[k - 1] + (moved * np.cos(heading), moved * np.sin(heading), turned)
    return poses


def aside_m(results: list[Result], poses: F64) -> F64:
    """Lateral distance of the car from the predicted path 30 m later, of each frame from which the drive goes on that
    far."""
    found = []
    for k, result in enumerate(results):
        x, y, heading = poses[k]
        c, s = np.cos(heading), np.sin(heading)
        local = (poses[k:, :2] - [x, y]) @ np.array([[c, -s], [s, c]])
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(local, axis=0).T))])
        if along[-1] >= LOOK_AHEAD_M:
            place = [[np.interp(LOOK_AHEAD_M, along, local[:, axis]) for axis in (0, 1)]]
            found.append(abs(float(offset(result.path, np.array(place))[0])))
    return np.array(found)


def _copied(folder: Path, has_oxts: bool) -> Path:
    skipped = shutil.ignore_patterns("label*") if has_oxts else shutil.ignore_patterns("label*", "oxts")
    return Path(
        shutil.copytree(data_dir() / _DAY, folder / "2011_09_26", ignore=skipped, copy_function=shutil.copyfile)
    )


def _frames(copy: Path, has_oxts: bool) -> list[Frame]:
    """Every frame, with what the lane network finds in its image, as in the product."""
    source = open_source(str(copy))
    lanes = lanes_for(source, "twinlitenet")
    networks = Detectors(
        None, lanes, usual_every(lanes, source.rate_hz), far_lanes=far_lanes_for(camera_of(source), lanes)
    )
    frames = [detect(source.frame(index), networks) for index in range(len(source))]
    assert all((frame.ego is not None) == has_oxts for frame in frames)
    return frames


def _results(frames: list[Frame], setup: Setup) -> Iterator[Result]:
    params = with_changes(Params(), dict(setup.changes))
    given = frames if setup.lanes else [_without_lanes(frame) for frame in frames]
    return (result for _, result in through(given, params, Detectors()))


def _without_lanes(frame: Frame) -> Frame:
    return replace(frame, raw_lanes=None)


def _cells(results: list[Result], own: list[EgoState], poses: F64) -> list[str]:
    known = [(each.ego, true) for each, true in zip(results, own, strict=True) if each.ego is not None]
    speed = [abs(ego.speed_mps - true.speed_mps) for ego, true in known]
    rate = [abs(degrees((ego.yaw_rate_radps or 0.0) - (true.yaw_rate_radps or 0.0))) for ego, true in known]
    aside = aside_m(results, poses)
    sigma = float(np.mean([each.path.sigma_m["30"] for each in results]))
    return [
        *(f"{np.mean(each):.2f}, {np.max(each):.2f}" if each else "–" for each in (speed, rate)),
        f"{aside.mean():.2f} m, {aside.max():.2f} m ({len(aside)} frames)",
        f"{sigma:.2f} m",
    ]


if __name__ == "__main__":
    sys.exit(main())
