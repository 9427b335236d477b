"""What can hardly be so, by what the sensors saw."""

from __future__ import annotations

import httpx
import pytest

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
