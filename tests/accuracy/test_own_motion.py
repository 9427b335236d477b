"""Own motion from the LiDAR alone, and the path that it predicts, on a street that an inertial unit was driven through.

KITTI 2011_09_26 drive 0009 cut down to a VLP-16's rings; ``oxts`` serves as the truth only."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import degrees
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.path.corridor import offset
from pipeline.run import through
from pipeline.types import F64, EgoState, Frame, Result
from tests.accuracy.drives import FOLDERS, frames_of

LOOK_AHEAD_M = 30.0


class Driven(NamedTuple):
    """The street's frames, and the pose of each from the inertial unit."""

    frames: tuple[Frame, ...]
    own: tuple[EgoState, ...]
    poses: F64
    """(N, 3) x, y, heading."""


@cache
def street(data_dir: Path) -> Driven:
    frames = frames_of(f"kitti:{data_dir / FOLDERS['street']}")
    own = tuple(frame.ego for frame in frames if frame.ego is not None)
    poses = np.zeros((len(frames), 3))
    for k in range(1, len(frames)):
        dt_s = (frames[k].t_ns - frames[k - 1].t_ns) / 1e9
        turned = 0.5 * ((own[k].yaw_rate_radps or 0.0) + (own[k - 1].yaw_rate_radps or 0.0)) * dt_s
        moved = 0.5 * (own[k].speed_mps + own[k - 1].speed_mps) * dt_s
        heading = poses[k - 1, 2] + 0.5 * turned
        poses[k] = poses[k - 1] + (moved * np.cos(heading), moved * np.sin(heading), turned)
    return Driven(frames, own, poses)


@cache
def results(data_dir: Path, source: str) -> tuple[Result, ...]:
    """LiDAR, and ego motion from this source only; without lane lines."""
    frames = street(data_dir).frames
    if source != "can":
        frames = tuple(replace(frame, ego=None, gnss=None) for frame in frames)
    params = with_changes(Params(), {"motion.source": source})
    return tuple(result for _, result in through(frames, params, Detectors()))


def aside_m(data_dir: Path, source: str) -> F64:
    """Lateral distance of the car from the predicted path 30 m later, if the recording continues that far."""
    poses, found = street(data_dir).poses, []
    for k, result in enumerate(results(data_dir, source)):
        x, y, heading = poses[k]
        later = poses[k:, :2] - [x, y]
        c, s = np.cos(heading), np.sin(heading)
        local = later @ np.array([[c, -s], [s, c]])
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(local, axis=0).T))])
        if along[-1] >= LOOK_AHEAD_M:
            place = [[np.interp(LOOK_AHEAD_M, along, local[:, axis]) for axis in (0, 1)]]
            found.append(abs(float(offset(result.path, np.array(place))[0])))
    return np.array(found)


def test_speed_and_yaw_rate_are_those_of_the_inertial_unit(data_dir: Path) -> None:
    found = [(result.ego, own) for result, own in zip(results(data_dir, "auto"), street(data_dir).own, strict=True)]
    assert [ego is None for ego, _ in found[:4]] == [True, True, True, False], "from the fourth sweep on"
    measured = [(ego, own) for ego, own in found if ego is not None]
    assert len(measured) == len(found) - 3
    assert all(ego.source == "lidar" for ego, _ in measured)
    speed = np.array([ego.speed_mps - own.speed_mps for ego, own in measured])
    turning = np.array([degrees((ego.yaw_rate_radps or 0.0) - (own.yaw_rate_radps or 0.0)) for ego, own in measured])
    assert np.abs(speed).mean() <= 0.15
    assert np.abs(turning).mean() <= 0.15
    sigmas = [result.own_motion.speed.speed_sigma_mps for result in results(data_dir, "auto") if result.own_motion]
    assert 0.3 < np.sqrt(np.mean((speed / sigmas) ** 2)) < 1.5, "errors are as large as it says"


def test_the_path_is_as_good_as_with_the_inertial_unit(data_dir: Path) -> None:
    by_lidar, by_ins = aside_m(data_dir, "auto"), aside_m(data_dir, "can")
    assert len(by_lidar) >= 20
    assert by_lidar.mean() <= 0.5
    assert by_lidar.mean() <= by_ins.mean() + 0.1


def test_the_same_sweeps_give_the_same_motion(data_dir: Path) -> None:
    frames = [replace(frame, ego=None, gnss=None) for frame in street(data_dir).frames[:8]]
    again = [result.ego for _, result in through(frames, Params(), Detectors())]
    assert again == [result.ego for result in results(data_dir, "auto")[:8]]
