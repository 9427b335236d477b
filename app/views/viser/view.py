"""The 3D view in a browser: one viser server on loopback that shows the newest frame to every client.

Every scene node has a fixed name and is replaced in place, so the number of nodes does not grow over days, and a
browser that joins late gets the current state from viser.
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import rich
import viser

from app.core.shared_view_state import NOTHING, FrameInView, OnDrag, PageView
from app.views.ray_picking import object_on_ray
from app.views.viser import nodes as viser_nodes
from app.views.viser.browser_scene import BrowserScene
from app.views.viser.frame_scene import COLOR_BY, NAMED, DisplayOptions, FrameScene, floor_of
from app.views.viser.gui import OnChange, ParamsGui
from app.views.viser.internal_port import PAGE, demanding_the_secret
from pipeline.params import Params
from pipeline.types import Frame, Point3, Result

# A browser may leave while its view is drawn; viser drops the message, and its warning would only worry the user.
warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)

OnPick = Callable[[str, int | None], None]
ViewOf = Callable[[str], PageView]
HOST = "127.0.0.1"
CAMERA_FOV_DEG = 48.0


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
        self._shown: FrameInView | None = None
        self._display = DisplayOptions()
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
        self._frame_scene = FrameScene(self._scene)
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
        """Show this frame to all browsers whose page follows the shared playhead, including those that join later.
        Thread-safe."""
        with self._lock:
            self._shown = FrameInView(frame, result)
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
        client.camera.on_update(lambda _: self._camera_moved(client.client_id))

    def _camera_moved(self, client_id: int) -> None:
        with self._lock:
            _, browser = self._browsers.get(client_id, (None, None))
            if browser is not None:
                browser.camera_moved()

    # on the event loop: after all messages that it sent before
    async def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            _, browser = self._browsers.pop(client.client_id, (None, None))
        if browser is not None:
            browser.leave()

    def _clicked(self, click: viser.SceneClickEvent) -> None:
        with self._lock:
            page, _ = self._browsers.get(click.client_id, ("", None))
        self._on_pick(page, self._met(page, click.ray_origin, click.ray_direction))

    def _met(self, page: str, origin: Point3, direction: Point3) -> int | None:
        """The object hit by a click's ray, in the frame that this page shows."""
        with self._lock:
            shown = self._view_of(page).frame or self._shown
        if shown is None:
            return None
        return object_on_ray(shown.result.objects, origin, direction, floor_of(shown.result))

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
            color_by = gui.add_dropdown("Colour by", COLOR_BY, initial_value=start.color_by)
            size = gui.add_slider("Point size (m)", 0.02, 0.4, 0.01, start.point_size_m)
            labels = gui.add_dropdown("Labels", NAMED, initial_value=start.named)
            image = gui.add_checkbox("Camera image", start.image)

        def chosen(_: Any) -> None:
            with self._lock:
                self._display = DisplayOptions(color_by.value, size.value, labels.value, image.value)
                self._draw()

        for handle in (color_by, size, labels, image):
            handle.on_update(chosen)

    # ------------------------------------------------------------ one frame

    def _draw(self) -> None:
        if self._shown is not None:
            with self._server.atomic():
                self._frame_scene.draw(self._shown.frame, self._shown.result, self._display)
        self._draw_browsers()

    def _draw_browsers(self) -> None:
        for page, browser in self._browsers.values():
            view = self._view_of(page)
            shown = view.frame or self._shown
            if shown is not None:
                browser.draw(view, shown.result, self._display)


class _silent:
    """Suppresses viser's own output of its address, which is not the one to open."""

    def __enter__(self) -> None:
        self._was = rich.get_console().quiet
        rich.get_console().quiet = True

    def __exit__(self, *_: object) -> None:
        rich.get_console().quiet = self._was
