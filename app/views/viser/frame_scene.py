"""One frame as drawn in the 3D view: points, objects, path, lanes and camera image. In the scene of all browsers it is
the shared frame; in the scene of one browser it is the frame of a page with its own playhead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np
import viser

from app.views import scene
from app.views.colors import ColorRole, rgb
from app.views.viser import nodes as viser_nodes
from app.views.viser.nodes import Strokes
from pipeline.types import Frame, FusedObject, Result

OBJECTS = ("/cuboids", "/footprints", "/rays", "/velocities", "/cipv", "/next_cipv")
"""Nodes of the pipeline's objects. Their name tags depend on the camera: see ``BrowserScene``."""
OTHERS = ("/points", "/path/ribbon", "/path/lines", "/path/lanes", "/camera/image", "/camera/edges")
ALWAYS = ("/grid", "/ego")
COLOR_BY = get_args(scene.ColorBy)
NAMED = ("vehicles and in path", "all", "none")
"""Choices of which objects have name tags."""
_ARROW_S = 1.0


@dataclass(frozen=True)
class DisplayOptions:
    """The user's display options."""

    color_by: scene.ColorBy = "kind"
    """What the colour of a point means."""
    point_size_m: float = 0.06
    """Diameter of a point."""
    named: str = NAMED[0]
    """Which objects have name tags."""
    image: bool = True
    """Whether the camera image is shown."""


class FrameScene:
    """Draws frames into a scene, each in place of the one before."""

    def __init__(self, scene_api: viser.SceneApi) -> None:
        self._scene = scene_api

    def draw(self, frame: Frame, result: Result, options: DisplayOptions, *, has_objects: bool = True) -> None:
        """has_objects: whether the pipeline's objects are drawn."""
        floor_m = floor_of(result)
        points = result.layers.points
        viser_nodes.cloud(
            self._scene, points[:, :3], scene.point_colors(result, options.color_by), options.point_size_m
        )
        self._draw_objects(frame, result, result.objects if has_objects else (), floor_m)
        viser_nodes.path(self._scene, result.path, floor_m)
        viser_nodes.lanes(self._scene, scene.lane_lines(result), floor_m)
        viser_nodes.floor(self._scene, floor_m)
        viser_nodes.image(self._scene, frame, options.image)

    def _draw_objects(self, frame: Frame, result: Result, objects: tuple[FusedObject, ...], floor_m: float) -> None:
        cuboids, footprints, rays, velocities = Strokes(), Strokes(), Strokes(), Strokes()
        eye = viser_nodes.camera_position(frame)
        for each in objects:
            outline = scene.flat_outline(each, floor_m + 0.05)
            if outline is None:
                continue
            color, middle = scene.object_color(each, result), outline[:-1].mean(axis=0)
            if each.cuboid is not None:
                cuboids.add(scene.cuboid_edges(each.cuboid), color)
            else:
                footprints.add(np.stack([outline[:-1], outline[1:]], axis=1), color)
                rays.add(np.array([[eye, middle]]), color)
            if each.velocity_mps is not None and scene.stands_out(each, result):
                velocities.add(np.stack([middle, middle + np.array([*each.velocity_mps, 0.0]) * _ARROW_S]), color)
        viser_nodes.lines(self._scene, "/cuboids", cuboids, 2.5)
        viser_nodes.lines(self._scene, "/footprints", footprints, 2.5)
        viser_nodes.lines(self._scene, "/rays", rays, 1.0)
        viser_nodes.arrows(self._scene, velocities)
        by_id = {each.id: each for each in objects}
        following = None if result.next_cipv is None else result.next_cipv.id
        marked: tuple[tuple[str, int | None, ColorRole, float], ...] = (
            ("/cipv", scene.cipv_id(result), "cipv", 0.25),
            ("/next_cipv", following, "cipv", 0.08),
        )
        for name, number, role, opacity in marked:
            found = None if number is None else by_id.get(number)
            viser_nodes.filled(self._scene, name, found, rgb(role), opacity, floor_m)


class OwnFrameScene(FrameScene):
    """The frame of one page, drawn into the scene of its browser, where nodes override the shared ones of the same
    name. A part that this frame lacks is covered by an empty node, since the shared one would show."""

    def __init__(self, scene_api: viser.SceneApi) -> None:
        super().__init__(scene_api)
        cover(scene_api, (*OBJECTS, *OTHERS))

    def clear(self) -> None:
        """Show the shared frame again."""
        for name in (*OBJECTS, *OTHERS, *ALWAYS):
            handle = self._scene.get_handle_by_name(name)
            if handle is not None:
                handle.remove()


def cover(scene_api: viser.SceneApi, names: tuple[str, ...]) -> list[viser.FrameHandle]:
    """Hide shared nodes in the scene of one browser."""
    return [scene_api.add_frame(name, show_axes=False, visible=False) for name in names]


def floor_of(result: Result) -> float:
    """Height of the ground in the ego frame, metres; 0 if it is unknown."""
    return scene.ground_height_m(result) or 0.0


def has_name(each: FusedObject, result: Result, named: str) -> bool:
    """Whether an object has a name tag, by the user's choice, one of ``NAMED``."""
    if named == "all":
        return True
    return named == NAMED[0] and scene.stands_out(each, result)
