"""Implausible labels, judged by the sensors' data."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from app.labels.service.checks import above_road_m
from pipeline.common.geometry import Cuboid
from pipeline.sources import open_source
from tests.app.labels.site import act, labels


@pytest.mark.parametrize(
    ("z", "said"), [(0.15, None), (-0.85, "its bottom is 1.0 m below the road"), (1.0, "m above the road")]
)
def test_a_cuboid_in_or_over_the_road_is_said(client: httpx.Client, z: float, said: str | None) -> None:
    cuboid = {"center": [28.2, 0.0, z], "size": [4.4, 1.8, 1.5], "yaw_rad": 0.0}
    act(client, kind="add_track", label="car", frame=10, cuboid=cuboid, bbox=None)
    assert len(labels(client)["tracks"]) == 1
    words = [each["words"] for each in client.get("/api/labels/checks").json()["problems"]]
    off_road = [each for each in words if "the road" in each]
    assert len(off_road) == (said is not None)
    assert said is None or said in off_road[0]


def test_the_road_is_where_its_points_are_when_a_plane_misses_it(data_dir: Path) -> None:
    """KITTI 0009: the street curves upwards, and the plane beside it is more than a metre too high."""
    folder = data_dir / "kitti_0009" / "2011_09_26" / "2011_09_26_drive_0009_sync"
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    sweep = open_source(f"kitti:{folder}").frame(38).sweep
    assert sweep is not None
    parked = Cuboid((19.4, 6.0, -0.9), (3.7, 1.6, 1.5), 0.0)
    assert abs(above_road_m(sweep.points, parked)) < 0.3
    raised = parked._replace(center=(19.4, 6.0, 0.1))
    lowered = parked._replace(center=(19.4, 6.0, -1.9))
    assert above_road_m(sweep.points, lowered) < -0.5
    assert above_road_m(sweep.points, raised) > 0.5
