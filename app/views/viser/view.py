"""The 3D view in a browser: one viser server on loopback that shows the newest frame to every client.

Every scene node has a fixed name and is replaced in place, so the number of nodes does not grow over days, and a
browser that joins late gets the current state from viser.
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
import rich
import viser

from app.core.shared_view_state import NOTHING, OnDrag, PageView
from app.views import scene
from app.views.colors import ColorRole, rgb
from app.views.ray_picking import object_on_ray
from app.views.viser import nodes as viser_nodes
from app.views.viser.browser_scene import BrowserScene
from app.views.viser.gui import OnChange, ParamsGui
from app.views.viser.internal_port import PAGE, demanding_the_secret
from app.views.viser.nodes import Strokes
from pipeline.params import Params
from pipeline.types import Frame, FusedObject, Point3, Result

# A browser may leave while its view is drawn; viser drops the message, and its warning would only worry the user.
warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)

OnPick = Callable[[str, int | None], None]
ViewOf = Callable[[str], PageView]
HOST = "127.0.0.1"
CAMERA_FOV_DEG = 48.0
_LABELS = ("vehicles and in path", "all", "none")
_ARROW_S = 1.0


class ViewPose(NamedTuple):
    """Position, look-at point and up direction of a view. Ego frame, metres."""

    eye: Point3
    """Position of the camera."""
    target: Point3
    """The point it looks at."""
    up: Point3
    """The up direction of the view."""


POSES = {
    "Follow": ViewPose((-16.0, 0.0, 9.0), (20.0, 0.0, -1.0), (0.0, 0.0, 1.0)),
    "Top": ViewPose((28.0, 0.0, 75.0), (28.01, 0.0, 0.0), (1.0, 0.0, 0.0)),
    "Driver": ViewPose((-1.9, 0.36, 0.75), (30.0, 0.36, -0.2), (0.0, 0.0, 1.0)),
}
"""Behind and above the car, from above with the road upwards, and from the driver's seat."""


@dataclass(frozen=True)
class _Display:
    """The user's display options."""

    color_by: scene.ColorBy = "kind"
    point_size_m: float = 0.06
    labels: str = _LABELS[0]
    image: bool = True


class ViserView:
    """Starts the server at once. ``port`` 0 selects a free one; if a port is occupied, the next one is used without a
    message: read ``port``. Callbacks, on a thread of viser: ``on_change(name, value)`` for every slider that the user
    moves, ``on_drag(held, ended)`` for a dragged cuboid, ``on_pick(page, id)`` for every click into the scene, with the
    object that was hit or None. Pages are identified by name; ``view_of(page)`` returns the view state of a page."""

    def __init__(
        self,
        params: Params,
        on_change: OnChange = lambda name, value: None,
        port: int = 0,
        on_drag: OnDrag = lambda held, ended: None,
        on_pick: OnPick = lambda page, number: None,
        view_of: ViewOf = lambda page: NOTHING,
    ) -> None:
        self._lock = threading.Lock()
        self._shown: tuple[Frame, Result] | None = None
        self._display = _Display()
        self._labels = 0
        self._view_of, self._on_drag, self._on_pick = view_of, on_drag, on_pick
        self._browsers: dict[int, tuple[str, BrowserScene]] = {}
        with _silent(), demanding_the_secret():
            self._server = viser.ViserServer(HOST, port, label="CIPV Studio", verbose=False)
        self._server.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, control_width="small"
        )
        self._server.gui.main_panel.dock_right()  # beside the scene: a floating panel covers it, folded up too
        self._server.gui.main_panel.minimize()
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.up = POSES["Follow"]
        camera.fov = math.radians(CAMERA_FOV_DEG)
        self._scene = self._server.scene
        self._server.on_client_connect(self._came)
        self._server.on_client_disconnect(self._left)
        self._add_static()
        self._add_cameras()
        self._add_display_options()
        self._params = ParamsGui(self._server.gui, params, on_change)
        self._scene.on_click()(self._clicked)

    @property
    def watchers(self) -> int:
        """Number of browsers that show this view."""
        return len(self._server.get_clients())

    def on_watched(self, callback: Callable[[], None]) -> None:
        """Call ``callback``, on a thread of viser, when a browser connects."""
        self._server.on_client_connect(lambda _: callback())

    @property
    def port(self) -> int:
        """Its port on loopback."""
        return self._server.get_port()

    def show(self, frame: Frame, result: Result) -> None:
        """Show this frame to all browsers, including those that join later. Thread-safe."""
        with self._lock:
            self._shown = (frame, result)
            self._draw()

    def look(self) -> None:
        """Draw the current view state of the pages."""
        with self._lock:
            self._draw_browsers()

    def set_params(self, params: Params) -> None:
        """Set the sliders to these parameters, without calling ``on_change``."""
        self._params.set(params)

    def close(self) -> None:
        """Stop the server and disconnect all browsers."""
        with _silent():
            self._server.stop()

    async def _came(self, client: viser.ClientHandle) -> None:
        """On the event loop, where ``PAGE`` identifies the page."""
        with self._lock:
            self._browsers[client.client_id] = PAGE.get(), BrowserScene(client, self._on_drag)
            self._draw_browsers()

    # on the event loop: after all messages that it sent before
    async def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            _, browser = self._browsers.pop(client.client_id, (None, None))
        if browser is not None:
            browser.leave()

    def _clicked(self, click: viser.SceneClickEvent) -> None:
        with self._lock:
            page, _ = self._browsers.get(click.client_id, ("", None))
        self._on_pick(page, self._met(click.ray_origin, click.ray_direction))

    def _met(self, origin: Point3, direction: Point3) -> int | None:
        """The object hit by a click's ray."""
        with self._lock:
            shown = self._shown
        if shown is None:
            return None
        return object_on_ray(shown[1].objects, origin, direction, scene.ground_height_m(shown[1]) or 0.0)

    # ------------------------------------------------------------ static content

    def _add_static(self) -> None:
        viser_nodes.floor(self._scene, 0.0)
        self._scene.world_axes.visible = False

    def _add_cameras(self) -> None:
        """One button per pose; it moves the camera of the browser that pressed it."""
        group = self._server.gui.add_button_group("Camera", tuple(POSES))

        def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return
            pose, camera = POSES[event.target.value], event.client.camera
            with event.client.atomic():
                camera.up_direction, camera.position, camera.look_at = pose.up, pose.eye, pose.target

        group.on_click(take)

    def _add_display_options(self) -> None:
        gui, start = self._server.gui, self._display
        with gui.add_folder("Display", expand_by_default=False):
            color_by = gui.add_dropdown("Colour by", get_args(scene.ColorBy), initial_value=start.color_by)
            size = gui.add_slider("Point size (m)", 0.02, 0.4, 0.01, start.point_size_m)
            labels = gui.add_dropdown("Labels", _LABELS, initial_value=start.labels)
            image = gui.add_checkbox("Camera image", start.image)

        def chosen(_: Any) -> None:
            with self._lock:
                self._display = _Display(color_by.value, size.value, labels.value, image.value)
                self._draw()

        for handle in (color_by, size, labels, image):
            handle.on_update(chosen)

    # ------------------------------------------------------------ one frame

    def _draw(self) -> None:
        if self._shown is None:
            return
        frame, result = self._shown
        ground_m = scene.ground_height_m(result)
        floor_m = 0.0 if ground_m is None else ground_m
        with self._server.atomic():
            self._draw_points(result)
            self._draw_objects(frame, result, floor_m)
            self._draw_labels(result, floor_m)
            viser_nodes.path(self._scene, result.path, floor_m)
            viser_nodes.lanes(self._scene, scene.lane_lines(result), floor_m)
            viser_nodes.floor(self._scene, floor_m)
            viser_nodes.image(self._scene, frame, self._display.image)
        self._draw_browsers()

    def _draw_browsers(self) -> None:
        if self._shown is None:
            return
        _, result = self._shown
        floor_m = scene.ground_height_m(result) or 0.0
        for page, browser in self._browsers.values():
            browser.draw(self._view_of(page), result, floor_m)

    def _draw_points(self, result: Result) -> None:
        points = result.layers.points
        viser_nodes.cloud(
            self._scene, points[:, :3], scene.point_colors(result, self._display.color_by), self._display.point_size_m
        )

    def _draw_objects(self, frame: Frame, result: Result, floor_m: float) -> None:
        cuboids, footprints, rays, velocities = Strokes(), Strokes(), Strokes(), Strokes()
        eye = viser_nodes.camera_position(frame)
        for each in result.objects:
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
        by_id = {each.id: each for each in result.objects}
        following = None if result.next_cipv is None else result.next_cipv.id
        marked: tuple[tuple[str, int | None, ColorRole, float], ...] = (
            ("/cipv", scene.cipv_id(result), "cipv", 0.25),
            ("/next_cipv", following, "cipv", 0.08),
        )
        for name, number, role, opacity in marked:
            found = None if number is None else by_id.get(number)
            viser_nodes.filled(self._scene, name, found, rgb(role), opacity, floor_m)

    def _draw_labels(self, result: Result, floor_m: float) -> None:
        """Labels are numbered slots that objects reuse, instead of one node per object: the number of ids is
        unlimited."""
        named = [each for each in result.objects if self._has_label(each, result) and each.bev is not None]
        for place in range(max(len(named), self._labels)):
            if place < len(named):
                each = named[place]
                viser_nodes.name_tag(
                    self._scene, f"/labels/{place}", scene.object_text(each), scene.top_of(each, floor_m)
                )
            else:
                viser_nodes.name_tag(self._scene, f"/labels/{place}", "", None)
        self._labels = max(len(named), self._labels)

    def _has_label(self, each: FusedObject, result: Result) -> bool:
        if self._display.labels == "all":
            return True
        return self._display.labels == _LABELS[0] and scene.stands_out(each, result)


class _silent:
    """Suppresses viser's own output of its address, which is not the one to open."""

    def __enter__(self) -> None:
        self._was = rich.get_console().quiet
        rich.get_console().quiet = True

    def __exit__(self, *_: object) -> None:
        rich.get_console().quiet = self._was
