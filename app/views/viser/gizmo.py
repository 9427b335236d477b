"""Editing a cuboid in the 3D view: one gizmo moves and turns it, and a handle on each face except the bottom moves that
face. viser's gizmo cannot resize, so each handle is a gizmo that moves along one axis while the opposite face stays."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

import numpy as np
import viser

from app.core.shared_view_state import HeldCuboid, OnDrag
from app.views.scene import cuboid_edges
from pipeline.common.geometry import Cuboid
from pipeline.types import F64

NODE = "/held"
FACES = {"front": (0, 1), "rear": (0, -1), "left": (1, 1), "right": (1, -1), "top": (2, 1)}
"""Axis of each face and its sign: length forwards, width to the left, height up."""
_SMALLEST_M = 0.2
_KNOB_M = 0.8
_UPRIGHT = ((0.0, 0.0), (0.0, 0.0), (-1000.0, 1000.0))
"""A cuboid is upright: it rotates about z only."""
_COLOR = (255, 255, 255)


class CuboidGizmo:
    """Shown while a cuboid is edited. Thread-safe; ``on_drag`` is called on viser's event loop and must be quick. A
    drag belongs to the label on which it started, even if another one is selected meanwhile."""

    def __init__(self, scene: viser.SceneApi, on_drag: OnDrag) -> None:
        self._scene, self._on_drag = scene, on_drag
        self._lock = threading.Lock()
        self._wanted: HeldCuboid | None = None
        self._held: HeldCuboid | None = None
        self._before: Cuboid | None = None
        self._hand: int | None = None
        self._handles: dict[str, viser.TransformControlsHandle] = {}

    def hold(self, held: HeldCuboid | None) -> None:
        """Show it at this cuboid; None removes it. During a drag, the user's handle takes precedence."""
        with self._lock:
            self._wanted = held
            if self._before is None:
                self._show(held)

    def leave(self, client: int) -> None:
        """This browser disconnected: the cuboid that it dragged stays where it is."""
        with self._lock:
            held = self._held
            if self._before is None or held is None or client != self._hand:
                return
            self._let_go(held)
        self._on_drag(held, True)

    def _show(self, held: HeldCuboid | None) -> None:
        if held == self._held:
            return
        self._held = held
        if held is None:
            self._remove()
            return
        if not self._handles:
            self._add(held.cuboid)
        self._place(held.cuboid, None)

    def _add(self, cuboid: Cuboid) -> None:
        middle = self._scene.add_transform_controls(
            f"{NODE}/move", max(1.5, cuboid.size[0] / 2), rotation_limits=_UPRIGHT, depth_test=False
        )
        self._handles["move"] = middle
        for face, (axis, _) in FACES.items():
            self._handles[face] = self._scene.add_transform_controls(
                f"{NODE}/{face}",
                _KNOB_M,
                active_axes=(axis == 0, axis == 1, axis == 2),
                disable_sliders=True,
                disable_rotations=True,
                depth_test=False,
            )
        for name, handle in self._handles.items():
            handle.on_update(self._follower(name))

    def _follower(self, name: str) -> Callable[[viser.TransformControlsEvent], Coroutine[Any, Any, None]]:
        # on the event loop, so that events arrive in order
        async def follow(event: viser.TransformControlsEvent) -> None:
            ended = event.phase == "end"
            with self._lock:
                if self._held is None or (self._before is not None and event.client_id != self._hand):
                    return
                self._before, self._hand = self._before or self._held.cuboid, event.client_id
                cuboid = moved(self._before, name, event.target.position, event.target.wxyz)
                self._held = held = replace(self._held, cuboid=cuboid)
                self._place(cuboid, None if ended else name)
                if ended:
                    self._let_go(held)
            if event.phase != "start":
                self._on_drag(held, ended)

        return follow

    def _let_go(self, held: HeldCuboid) -> None:
        """The drag has ended. From now on the page controls the position; a label selected meanwhile is shown."""
        self._before = self._hand = None
        if not held.is_of(self._wanted):
            self._show(self._wanted)

    def _place(self, cuboid: Cuboid, held: str | None) -> None:
        """Draw it, and position every handle except the dragged one."""
        edges = cuboid_edges(cuboid)
        self._scene.add_line_segments(f"{NODE}/edges", edges, _COLOR, thickness=3.0, thickness_units="screen")
        turn = (math.cos(cuboid.yaw_rad / 2), 0.0, 0.0, math.sin(cuboid.yaw_rad / 2))
        for name, handle in self._handles.items():
            if name == held:
                continue
            handle.wxyz = turn
            handle.position = tuple(np.array(cuboid.center) + (_to_face(cuboid, name) if name in FACES else 0.0))

    def _remove(self) -> None:
        for handle in self._handles.values():
            handle.remove()
        self._handles.clear()
        self._scene.remove_by_name(f"{NODE}/edges")


def moved(before: Cuboid, name: str, position: F64, wxyz: F64) -> Cuboid:
    """The cuboid after the handle ``name`` was dragged to a (3,) position and a (4,) quaternion."""
    if name not in FACES:
        x, y, z = (float(value) for value in position)
        return Cuboid((x, y, z), before.size, 2.0 * math.atan2(float(wxyz[3]), float(wxyz[0])))
    axis, _ = FACES[name]
    outward = _outward(before, name)
    reached = float((np.asarray(position) - before.center) @ outward)
    size = list(before.size)
    size[axis] = max(_SMALLEST_M, reached + before.size[axis] / 2)
    x, y, z = (np.array(before.center) + outward * (size[axis] - before.size[axis]) / 2).tolist()
    return Cuboid((x, y, z), (size[0], size[1], size[2]), before.yaw_rad)


def _outward(cuboid: Cuboid, face: str) -> F64:
    """(3,) outward unit normal of a face."""
    axis, side = FACES[face]
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    return side * np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)][axis])


def _to_face(cuboid: Cuboid, face: str) -> F64:
    """(3,) vector from the centre of the cuboid to the centre of a face."""
    return _outward(cuboid, face) * cuboid.size[FACES[face][0]] / 2
