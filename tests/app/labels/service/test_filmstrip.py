"""A track's filmstrip: where it begins and ends, its keyframes, and where it fits worst."""

from __future__ import annotations

import cv2
import httpx
import numpy as np

from app.engine.engine import Engine
from tests.app.labels.site import COUNT, act, labels, proposed


def test_keyframes_ends_and_the_worst_fitting_frames_are_shown_with_their_images(
    engine: Engine, client: httpx.Client
) -> None:
    track = proposed(engine, client)
    placed = client.get("/api/labels/frames?first=10&last=10").json()["sightings"]["10"][0]
    moved = placed["cuboid"] | {"center": [placed["cuboid"]["center"][0] + 0.4, *placed["cuboid"]["center"][1:]]}
    act(
        client, kind="set_sighting", track=track["id"], revision=track["revision"], frame=10, cuboid=moved,
        interpolate=False,
    )  # fmt: skip
    stills = {each["frame"]: each for each in client.get(f"/api/labels/tracks/{track['id']}/filmstrip").json()}
    assert (stills[0]["why"], stills[COUNT - 1]["why"], stills[10]["why"]) == ("end", "end", "keyframe")
    assert stills[10]["beside"] > stills[0]["beside"], "the points stayed where the car is"
    answer = client.get(f"/api/labels/tracks/{track['id']}/close_up?frame=10")
    assert answer.headers["content-type"] == "image/jpeg"
    assert cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR).shape == (220, 320, 3)
    assert client.get(f"/api/labels/tracks/{track['id']}/close_up?frame={COUNT + 5}").status_code == 204
    assert client.get("/api/labels/tracks/999/filmstrip").json() == [], "somebody has removed it meanwhile"
    assert labels(client)["tracks"][0]["id"] == track["id"]
