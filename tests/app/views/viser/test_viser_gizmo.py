"""A cuboid that is held in the 3D view: what arrives in a browser, and what a hand on its handles makes of it."""

from __future__ import annotations

import math
import queue
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.core.shared_view_state import HeldCuboid, PageView
from app.views.viser.gizmo import FACES, NODE, moved
from app.views.viser.view import ViserView
from pipeline.common.geometry import Cuboid
from pipeline.params import Params
from pipeline.types import Frame, Result

CAR = Cuboid((20.0, 1.0, 0.8), (4.0, 2.0, 1.5), 0.4)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
WAIT_S = 180.0
Drags = queue.Queue[tuple[HeldCuboid, bool]]
PAGE = object()


@pytest.fixture
def drags() -> Drags:
    return queue.Queue()


class Scene:
    """A 3D view that shows the same cuboid to every page."""

    def __init__(self, drags: Drags) -> None:
        self._wanted = PageView()
        self.view = ViserView(
            Params(), on_drag=lambda held, ended: drags.put((held, ended)), view_of=lambda page: self._wanted
        )

    @property
    def port(self) -> int:
        return self.view.port

    def hold(self, held: HeldCuboid | None) -> None:
        self._wanted = PageView(held=held)
        self.view.look()


@pytest.fixture
def view(drags: Drags, frame: Frame, result: Result) -> Iterator[Scene]:
    scene = Scene(drags)
    scene.view.show(frame, result)
    yield scene
    scene.view.close()


def turned(yaw_rad: float) -> np.ndarray:
    return np.array([math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)])


def outward(cuboid: Cuboid, face: str) -> np.ndarray:
    """(3,) direction out of a face: mean of its corners minus mean of all corners."""
    axis, side = FACES[face]
    corners = cuboid.corners() - cuboid.center
    own = corners @ np.array(
        [
            [math.cos(cuboid.yaw_rad), -math.sin(cuboid.yaw_rad), 0.0],
            [math.sin(cuboid.yaw_rad), math.cos(cuboid.yaw_rad), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    return corners[own[:, axis] * side > 0].mean(axis=0)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.4, -2.8])
@pytest.mark.parametrize("face", sorted(FACES))
def test_a_face_moves_and_the_opposite_one_stays(face: str, yaw_rad: float) -> None:
    before = CAR._replace(yaw_rad=yaw_rad)
    out = outward(before, face)
    step = out / np.linalg.norm(out)
    after = moved(before, face, np.array(before.center) + out + 0.7 * step, turned(yaw_rad))
    axis, _ = FACES[face]
    assert after.size[axis] == pytest.approx(before.size[axis] + 0.7)
    assert [after.size[i] for i in range(3) if i != axis] == [before.size[i] for i in range(3) if i != axis]
    np.testing.assert_allclose(np.array(after.center) - outward(after, face), np.array(before.center) - out, atol=1e-9)


def test_a_face_does_not_go_through_the_opposite_one() -> None:
    after = moved(CAR, "front", np.array(CAR.center) - 30.0, UPRIGHT)
    assert after.size[0] == pytest.approx(0.2)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -3.0])
def test_the_gizmo_moves_and_turns(yaw_rad: float) -> None:
    after = moved(CAR, "move", np.array([25.0, -1.0, 1.0]), turned(yaw_rad))
    assert after.center == (25.0, -1.0, 1.0)
    assert after.size == CAR.size
    assert after.yaw_rad == pytest.approx(yaw_rad)


def drag(client: Any, name: str, position: tuple[float, ...]) -> None:
    place = {"wxyz": (1.0, 0.0, 0.0, 0.0), "position": position}
    client._send("TransformControlsUpdateMessage", name=f"{NODE}/{name}", **place, owner=owner(client))


def owner(client: Any) -> str:
    """The browser that owns a handle, from the handle's name."""
    return next(str(each["owner"]) for each in client.messages if each.get("name", "").startswith(NODE))


def held(track: int, cuboid: Cuboid) -> HeldCuboid:
    return HeldCuboid(PAGE, track, 3, cuboid)


def grab(client: Any, name: str) -> None:
    client._send("TransformControlsDragStartMessage", name=f"{NODE}/{name}", owner=owner(client))


def test_a_browser_drags_it_and_the_hand_is_right_until_it_lets_go(view: Scene, drags: Drags, open_scene: Any) -> None:
    view.hold(held(7, CAR._replace(yaw_rad=0.0)))
    client = open_scene(view.port)
    client.look()
    client.read_until(lambda each: each.get("name") == f"{NODE}/edges")
    assert {f"{NODE}/{name}" for name in ("move", "edges", *FACES)} <= set(client.nodes())
    grab(client, "front")
    drag(client, "front", (23.0, 1.0, 0.8))
    assert drags.get(timeout=WAIT_S) == (held(7, Cuboid((20.5, 1.0, 0.8), (5.0, 2.0, 1.5), 0.0)), False)
    view.hold(held(9, CAR))
    drag(client, "front", (24.0, 1.0, 0.8))
    client._send("TransformControlsDragEndMessage", name=f"{NODE}/front", owner=owner(client))
    longest = held(7, Cuboid((21.0, 1.0, 0.8), (6.0, 2.0, 1.5), 0.0))
    assert drags.get(timeout=WAIT_S) == (longest, False), "another label is held by now: the hand has the first"
    assert drags.get(timeout=WAIT_S) == (longest, True)
    grab(client, "front")
    drag(client, "move", (5.0, 1.0, 0.8))
    assert drags.get(timeout=WAIT_S)[0].track == 9, "what was held meanwhile is there when the hand is free"
    client._send("TransformControlsDragEndMessage", name=f"{NODE}/move", owner=owner(client))
    assert drags.get(timeout=WAIT_S)[1]
    view.hold(None)
    client.read_until(lambda each: each["type"] == "RemoveSceneNodeMessage" and each["name"] == f"{NODE}/edges")
    assert not {name for name, shown in client.nodes().items() if name.startswith(f"{NODE}/") and shown}


def test_a_browser_that_goes_away_lets_go(view: Scene, drags: Drags, open_scene: Any) -> None:
    view.hold(held(7, CAR._replace(yaw_rad=0.0)))
    client, other = open_scene(view.port), open_scene(view.port)
    for each in (client, other):
        each.look()
        each.read_until(lambda said: said.get("name") == f"{NODE}/edges")
    grab(client, "front")
    drag(client, "front", (23.0, 1.0, 0.8))
    brought = held(7, Cuboid((20.5, 1.0, 0.8), (5.0, 2.0, 1.5), 0.0))
    assert drags.get(timeout=WAIT_S) == (brought, False)
    client.connection.close()
    assert drags.get(timeout=WAIT_S) == (brought, True)
    view.hold(held(9, CAR._replace(yaw_rad=0.0)))
    drag(other, "front", (23.0, 1.0, 0.8))
    assert drags.get(timeout=WAIT_S)[0].track == 9
