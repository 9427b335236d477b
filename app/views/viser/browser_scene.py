"""The parts of the 3D view that belong to one browser: its page's selection, its labels, the cuboid being edited, and
the frame of a page with its own playhead."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import viser

from app.core.shared_view_state import FrameInView, LabelInView, LabelsInView, OnDrag, PageView
from app.views import scene
from app.views.colors import rgb
from app.views.viser import nodes as viser_nodes
from app.views.viser.frame_scene import OBJECTS, DisplayOptions, OwnFrameScene, cover, floor_of, has_name
from app.views.viser.gizmo import CuboidGizmo
from app.views.viser.nodes import Strokes
from app.views.viser.tags import NameTag, ViewCamera, arranged
from pipeline.common.geometry import Cuboid
from pipeline.types import F64, FusedObject, Point3, Result

LABELS = "/own"
_LIFT_M = 0.3
_WIDTH_PX = {False: 2.0, True: 4.0}
_OBJECT_SCALE, _LABEL_SCALE, _CHOSEN_SCALE = 0.8, 1.3, 1.6
"""Size of the name tags of objects, of labels and of the selected label."""
_CHOSEN, _LEAD, _NEXT, _LABELED, _IN_PATH, _OTHER = range(6)
"""Ranks of name tags: where there is no room for all, the first ones have it."""
_BACK, _LEAST_BACK_M = 2.5, 9.0
"""Distance of the camera from a selected label, as a multiple of its longest side, and the minimum distance."""
_UP = 0.5
"""Height of the camera above it, as a share of that distance."""


class BrowserScene:
    """Draws into the scene of one browser. ``on_drag``: see ``CuboidGizmo``."""

    def __init__(self, client: viser.ClientHandle, on_drag: OnDrag) -> None:
        self._client, self._scene = client, client.scene
        self._gizmo = CuboidGizmo(client.scene, on_drag)
        self._label_tags: list[NameTag] = []
        self._tags: list[NameTag] = []
        self._texts: list[str] = []
        self._covers: list[viser.FrameHandle] = []
        self._drawn: tuple[LabelsInView | None, int | None] = (None, None)
        self._followed: int | None = None
        self._own: OwnFrameScene | None = None
        self._own_drawn: tuple[FrameInView, DisplayOptions, bool] | None = None

    def leave(self) -> None:
        """The browser has disconnected."""
        self._gizmo.leave(self._client.client_id)

    def draw(self, view: PageView, result: Result, options: DisplayOptions) -> None:
        """Draw the page's view state. During playback, its labels follow a moment after the frame. result: of the frame
        that the page shows."""
        floor_m = floor_of(result)
        found = next((each for each in result.objects if each.id == view.selected), None)
        viser_nodes.filled(self._scene, "/selection", found, rgb("ego"), 0.2, floor_m)
        is_alone = view.labels is not None and view.labels.alone
        self._hide_objects(is_alone and view.frame is None)
        self._draw_frame(view.frame, options, has_objects=not is_alone)
        wanted = (view.labels, None if view.held is None else view.held.track)
        if wanted != self._drawn:
            self._draw_labels(() if view.labels is None else view.labels.labels, wanted[1])
            self._drawn = wanted
        named = "none" if is_alone else options.named
        self._name([*self._label_tags, *_object_tags(result, named, view.selected, floor_m)])
        self._gizmo.hold(view.held)
        self._follow(view)

    def _hide_objects(self, hides: bool) -> None:
        """Of the shared frame."""
        if hides and not self._covers:
            self._covers = cover(self._scene, OBJECTS)
        elif not hides:
            for each in self._covers:
                each.remove()
            self._covers = []

    def _draw_frame(self, shown: FrameInView | None, options: DisplayOptions, *, has_objects: bool) -> None:
        """The page's own frame; None: the shared one."""
        wanted = None if shown is None else (shown, options, has_objects)
        if wanted == self._own_drawn:
            return
        self._own_drawn = wanted
        with self._client.atomic():
            if shown is None:
                if self._own is not None:
                    self._own.clear()
                self._own = None
                return
            if self._own is None:
                self._own = OwnFrameScene(self._scene)
            self._own.draw(shown.frame, shown.result, options, has_objects=has_objects)

    def _draw_labels(self, labels: tuple[LabelInView, ...], chosen: int | None) -> None:
        for is_chosen, width_px in _WIDTH_PX.items():
            strokes = Strokes()
            for each in labels:
                if (each.track == chosen) is is_chosen:
                    strokes.add(_outline(each), rgb(each.role))
            viser_nodes.lines(self._scene, f"{LABELS}/{'chosen' if is_chosen else 'cuboids'}", strokes, width_px)
        self._label_tags = [_label_tag(each, is_chosen=each.track == chosen) for each in labels]

    def _name(self, tags: list[NameTag]) -> None:
        """Show these name tags, in numbered slots that they reuse: the number of ids is unlimited."""
        left = [""] * (len(self._tags) - len(tags))
        self._tags = tags
        with self._client.atomic():
            self._show_names([*arranged(tags, self._camera()), *left])
        self._texts = self._texts[: len(tags)]

    def camera_moved(self) -> None:
        """Other name tags have room now."""
        texts = arranged(self._tags, self._camera())
        if texts != self._texts:
            with self._client.atomic():
                self._show_names(texts)

    def _show_names(self, texts: Sequence[str]) -> None:
        for place, text in enumerate(texts):
            tag = self._tags[place] if text else None
            viser_nodes.name_tag(
                self._scene, f"{LABELS}/names/{place}", text, tag and tag.at, tag.scale if tag else _OBJECT_SCALE
            )
        self._texts = list(texts)

    def _camera(self) -> ViewCamera:
        camera = self._client.camera
        return ViewCamera(camera.position, camera.wxyz, camera.fov, camera.image_width, camera.image_height)

    def _follow(self, view: PageView) -> None:
        """Move the camera to a label when it is selected; afterwards the user controls it."""
        track = None if view.held is None else view.held.track
        if track is not None and track != self._followed and view.held is not None:
            eye, target = looking_at(view.held.cuboid)
            camera = self._client.camera
            with self._client.atomic():
                camera.up_direction, camera.position, camera.look_at = (0.0, 0.0, 1.0), eye, target
        self._followed = track


def looking_at(cuboid: Cuboid) -> tuple[Point3, Point3]:
    """Camera position and target to see a cuboid: from above, on the side towards the ego car."""
    x, y, z = cuboid.center
    away_m = math.hypot(x, y)
    toward = (x / away_m, y / away_m) if away_m > 1.0 else (1.0, 0.0)
    back_m = max(_LEAST_BACK_M, _BACK * max(cuboid.size))
    return (x - toward[0] * back_m, y - toward[1] * back_m, z + back_m * _UP), (x, y, z)


def _outline(label: LabelInView) -> F64:
    """(12 or 13, 2, 3) edges, and if the front is known, a line to it on the roof."""
    edges = scene.cuboid_edges(label.cuboid)
    if not label.facing:
        return edges
    x, y, _ = label.cuboid.center
    top = label.cuboid.center[2] + label.cuboid.size[2] / 2
    ahead = label.cuboid.size[0] / 2
    nose = (x + math.cos(label.cuboid.yaw_rad) * ahead, y + math.sin(label.cuboid.yaw_rad) * ahead, top)
    return np.concatenate([edges, np.array([[(x, y, top), nose]])])


def _label_tag(label: LabelInView, *, is_chosen: bool) -> NameTag:
    x, y, z = label.cuboid.center
    top: Point3 = (x, y, z + label.cuboid.size[2] / 2 + _LIFT_M)
    rank = _CHOSEN if is_chosen else _LEAD if label.role == "cipv" else _LABELED
    return NameTag(label.text, f"#{label.track}", top, rank, _CHOSEN_SCALE if is_chosen else _LABEL_SCALE)


def _object_tags(result: Result, named: str, selected: int | None, floor_m: float) -> list[NameTag]:
    """Name tags of the objects that have one, by the user's choice ``named``, and of the selected one."""
    wanted = [each for each in result.objects if each.id == selected or has_name(each, result, named)]
    following = None if result.next_cipv is None else result.next_cipv.id

    def rank(each: FusedObject) -> int:
        if each.id == selected:
            return _CHOSEN
        if each.id == scene.cipv_id(result):
            return _LEAD
        return _NEXT if each.id == following else _IN_PATH if each.in_path else _OTHER

    return [
        NameTag(scene.object_text(each), f"#{each.id}", scene.top_of(each, floor_m), rank(each), _OBJECT_SCALE)
        for each in wanted
        if each.bev is not None
    ]
