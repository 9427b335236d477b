"""On real drives the lead is one compact cluster, as far away as its label, and one track with the right speed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid, closest_on_polygon
from pipeline.lidar.boxes import fit_obstacles
from pipeline.lidar.cluster import candidates, cluster
from pipeline.lidar.ground import Ground, fit_ground
from pipeline.lidar.tracking import LidarTrackerState, track
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import F32, I32, LidarTrack, Obstacle
from pipeline.types.source import TruthObject
from tests.pipeline.lidar.scenes import real_frames

VEHICLES = {"car", "van", "truck", "bus"}
FOLLOWING = {*range(60, 69), *range(183, 193), *range(414, 426), 7, 14, 21}
"""Frames with a labelled vehicle in lane, Astyx and KITTI."""


def _see(points: F32) -> tuple[Ground, I32, tuple[Obstacle, ...]]:
    params, keep = Params(), np.ones(len(points), np.bool_)
    ground = fit_ground(points, keep, params.ground)
    labels = cluster(points, candidates(points, ground, keep, params.cluster), params.cluster)
    return ground, labels, fit_obstacles(points, labels, ground, params.box)


def _inside(points: F32, box: Cuboid, margin_m: float) -> np.ndarray:
    offset = points[:, :2] - np.array(box.center[:2])
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    along, across = offset @ [c, s], offset @ [-s, c]
    return (np.abs(along) < box.size[0] / 2 + margin_m) & (np.abs(across) < box.size[1] / 2 + margin_m)


def _lead(truth: tuple[TruthObject, ...]) -> Cuboid | None:
    """The nearest labelled vehicle in lane whose nearest face is 5 m to 35 m ahead."""
    rear = {t.cuboid.center[0] - t.cuboid.size[0] / 2: t.cuboid for t in truth if t.label in VEHICLES}
    in_lane = {x: box for x, box in rear.items() if 5.0 < x < 35.0 and abs(box.center[1]) < 1.5}
    return in_lane[min(in_lane)] if in_lane else None


def _following(data_dir: Path) -> Iterator[tuple[str, F32, tuple[TruthObject, ...], Cuboid]]:
    for frame, truth in real_frames(data_dir):
        lead = _lead(truth)
        if int(frame.name) in FOLLOWING and lead is not None:
            assert frame.sweep is not None
            yield frame.name, frame.sweep.points, truth, lead


def test_the_lead_is_one_cluster_at_its_labels_distance(data_dir: Path) -> None:
    error_m = []
    for name, points, _, lead in _following(data_dir):
        _, labels, obstacles = _see(points)
        numbers, counts = np.unique(labels[_inside(points, lead, 0.3) & (labels >= 0)], return_counts=True)
        assert len(numbers) == 1, name
        obstacle = obstacles[numbers[0]]
        assert obstacle.points == counts[0], f"{name}: merged with something outside the label"
        assert 1.0 < obstacle.cuboid.size[1] < 2.3, name
        assert obstacle.cuboid.size[0] < 3.0, name
        assert abs(np.degrees(obstacle.cuboid.yaw_rad)) < 20.0, name
        error_m.append(np.hypot(*obstacle.closest_point[:2]) - np.hypot(*closest_on_polygon(lead.footprint())))
    assert len(error_m) == 34
    assert np.abs(error_m).max() < 0.3
    assert np.median(np.abs(error_m)) < 0.1


def test_nothing_stands_between_ego_and_its_lead(data_dir: Path) -> None:
    """No part of the road becomes an obstacle in the lane."""
    for name, points, truth, lead in _following(data_dir):
        _, labels, obstacles = _see(points)
        rear_m = lead.center[0] - lead.size[0] / 2
        for obstacle in obstacles:
            x, y, _ = obstacle.closest_point
            if 1.0 < x < rear_m - 0.5 and abs(y) < 1.5:
                of_a_vehicle = any(_inside(points[labels == obstacle.cluster], t.cuboid, 0.5).any() for t in truth)
                assert of_a_vehicle, f"{name}: {obstacle}"


@pytest.mark.parametrize("filter_name", ["kalman", "trajectory"])
@pytest.mark.parametrize(
    ("recording", "frames", "start_m", "speed_mps"),
    [("astyx", (414, 425), 32.2, -2.72), ("astyx", (183, 192), 24.2, -1.0), ("kitti_0052", (0, 22), 8.0, -0.75)],
    ids=["closing", "following", "slowing"],
)
def test_the_lead_is_one_track_with_the_speed_of_its_labels(
    data_dir: Path, recording: str, frames: tuple[int, int], start_m: float, speed_mps: float, filter_name: str
) -> None:
    params = Params().lidar_tracking.model_copy(update={"filter": filter_name})
    source = open_source(f"{recording.split('_')[0]}:{data_dir / recording}")
    state, before_ns, lead_id = LidarTrackerState(), None, None
    distance_m, speeds = [], []
    for index in range(len(source)):
        frame = source.frame(index)
        if not frames[0] <= int(frame.name) <= frames[1]:
            continue
        assert frame.sweep is not None
        dt_s = None if before_ns is None else (frame.t_ns - before_ns) / 1e9
        before_ns = frame.t_ns
        state, tracks = track(state, _see(frame.sweep.points)[2], dt_s, params)
        lead = _nearest_to(tracks, start_m) if lead_id is None else next(t for t in tracks if t.id == lead_id)
        lead_id = lead.id
        assert not lead.carried
        distance_m.append(lead.obstacle.closest_point[0])
        speeds.append(lead.velocity_mps)
    assert len(distance_m) == frames[1] - frames[0] + 1
    assert np.median([v[0] for v in speeds[3:] if v is not None]) == pytest.approx(speed_mps, abs=0.4)
    assert np.all(np.abs(np.diff(distance_m)) < 1.2)


def _nearest_to(tracks: tuple[LidarTrack, ...], x_m: float) -> LidarTrack:
    in_lane = [t for t in tracks if abs(t.obstacle.closest_point[1]) < 1.5]
    return min(in_lane, key=lambda t: abs(t.obstacle.closest_point[0] - x_m))
