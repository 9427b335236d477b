"""Where a cuboid lies in the shown image, as the page asks while a hand moves it."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import numpy as np
import pytest

from app.engine.engine import Engine
from app.web.routes.project import MOST_CUBOIDS
from app.web.server import create_app
from pipeline.alignment.projection import resolve
from pipeline.common.geometry import Cuboid
from tests.app.web.serving import WAIT_S, running, serving

AHEAD = {"center": [20.0, 1.0, 0.8], "size": [4.5, 1.8, 1.5], "yaw_rad": 0.1}


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with running() as engine:
        yield engine


@pytest.fixture(scope="module")
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def test_corners_lie_where_the_line_sees_them(engine: Engine, client: httpx.Client):
    found = client.post("/api/project", json={"cuboids": [AHEAD, AHEAD | {"yaw_rad": 1.0}]}).json()["pixels"]
    tick = engine.snapshot.processed
    assert tick is not None
    aligned = resolve(engine.snapshot.params.alignment, tick.frame.camera)
    assert aligned is not None
    for pixels, yaw_rad in zip(found, (0.1, 1.0), strict=True):
        cuboid = Cuboid((20.0, 1.0, 0.8), (4.5, 1.8, 1.5), yaw_rad)
        np.testing.assert_allclose(pixels, aligned.project(cuboid.corners()), atol=0.006)


def test_what_lies_behind_the_camera_is_nowhere_in_its_image(client: httpx.Client):
    behind = AHEAD | {"center": [-20.0, 0.0, 0.8]}
    assert client.post("/api/project", json={"cuboids": [behind]}).json() == {"pixels": [[None] * 8]}


def test_nothing_is_asked_and_nothing_is_answered(client: httpx.Client):
    assert client.post("/api/project", json={"cuboids": []}).json() == {"pixels": []}


@pytest.mark.parametrize("place", [(8.0, 0.0, -0.4), (20.0, 3.5, 1.0), (60.0, -5.0, 0.3)])
def test_a_pixel_looks_along_what_is_seen_there(
    engine: Engine, client: httpx.Client, place: tuple[float, float, float]
):
    tick = engine.snapshot.processed
    assert tick is not None
    aligned = resolve(engine.snapshot.params.alignment, tick.frame.camera)
    assert aligned is not None
    (pixel,) = aligned.project(np.array([place])).tolist()
    found = client.post("/api/project/ray", json={"pixel": pixel}).json()
    start, toward = np.array(found["start"]), np.array(found["toward"])
    off = np.array(place) - start
    assert np.linalg.norm(np.cross(toward, off)) / np.linalg.norm(toward) < 1e-6, "the place is on the ray"
    assert toward @ off > 0.0, "and ahead"


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"cuboids": [AHEAD | {"size": [1, 2]}]},
        {"cuboids": [AHEAD | {"colour": "red"}]},
        {"cuboids": [AHEAD] * (MOST_CUBOIDS + 1)},
        {"cuboids": [AHEAD | {"size": [4.5, -1.8, 1.5]}]},
        {"cuboids": [AHEAD | {"size": [4.5, 1.8, 0.0]}]},
        {"cuboids": [AHEAD | {"center": [1e9, 0.0, 0.0]}]},
    ],
)
def test_what_is_no_cuboid_is_refused_in_a_sentence(client: httpx.Client, body: dict[str, object]):
    answer = client.post("/api/project", json=body)
    assert answer.status_code == 422
    assert isinstance(answer.json()["detail"], str)
