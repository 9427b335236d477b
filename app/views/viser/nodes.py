"""One function per part of the 3D scene. Each sets its node under a fixed name, or hides it when there is nothing to
show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
import viser
import viser.transforms

from app.views import scene as outlines
from app.views.colors import Rgb, rgb
from pipeline.common.geometry import F64, inverse, transform
from pipeline.types import Frame, FusedObject, Path, Point3

_IMAGE_DISTANCE_M = 2.5
_IMAGE_WIDTH_PX = 640


def cloud(scene: viser.SceneApi, points: npt.NDArray[np.float32], colors: outlines.U8, size_m: float) -> None:
    """(N, 3) points with (N, 3) colours."""
    if len(points):
        scene.add_point_cloud(
            "/points",
            points,
            colors,
            point_size=size_m,
            point_shape="circle",
            precision="float32",
            point_shading="flat",
        )
    else:
        _hide(scene, "/points")


@dataclass
class Strokes:
    """The parts of one node, each with its colour."""

    parts: list[F64] = field(default_factory=list)
    """(K, 2, 3) line segments each, ego frame."""
    colors: list[Rgb] = field(default_factory=list)
    """One per part."""

    def add(self, part: F64, color: Rgb) -> None:
        self.parts.append(part)
        self.colors.append(color)


def lines(scene: viser.SceneApi, name: str, strokes: Strokes, width_px: float) -> None:
    """Each part is (K, 2, 3) segments."""
    if not strokes.parts:
        return _hide(scene, name)
    counts = [len(part) for part in strokes.parts]
    colors = np.repeat(_linear(strokes.colors), counts, axis=0)
    both_ends = np.repeat(colors[:, None, :], 2, axis=1)
    scene.add_line_segments(
        name, np.concatenate(strokes.parts), both_ends, thickness=width_px, thickness_units="screen"
    )


def arrows(scene: viser.SceneApi, strokes: Strokes) -> None:
    """Each part is (2, 3): where an arrow starts and ends."""
    if not strokes.parts:
        return _hide(scene, "/velocities")
    scene.add_arrows(
        "/velocities",
        np.stack(strokes.parts),
        _linear(strokes.colors),
        shaft_radius=0.05,
        head_radius=0.15,
        head_length=0.4,
    )


def filled(
    scene: viser.SceneApi, name: str, each: FusedObject | None, color: Rgb, opacity: float, floor_m: float
) -> None:
    """An object as a solid box, for all sources."""
    if each is None or each.bev is None:
        return _hide(scene, name)
    corners = np.asarray(each.bev)
    if each.cuboid is not None:
        center, size, yaw_rad = each.cuboid.center, each.cuboid.size, each.cuboid.yaw_rad
    else:
        edge = corners[0] - corners[3]
        size = (float(np.hypot(*edge)), float(np.hypot(*(corners[0] - corners[1]))), 0.1)
        x, y = corners.mean(axis=0)
        center, yaw_rad = (float(x), float(y), floor_m + 0.05), float(np.arctan2(edge[1], edge[0]))
    wxyz = viser.transforms.SO3.from_z_radians(yaw_rad).wxyz
    scene.add_box(
        name, color, size, opacity=opacity, wxyz=wxyz, position=center, cast_shadow=False, receive_shadow=False
    )


def lanes(scene: viser.SceneApi, found: Sequence[F64], floor_m: float) -> None:
    """The ego lane's lines, each (K, 2) ego x y."""
    parts = [_segments(outlines.on_ground(line, floor_m + 0.05)) for line in found if len(line) > 1]
    lines(scene, "/path/lanes", Strokes(parts, [rgb("lane")] * len(parts)), 4.0)


def name_tag(scene: viser.SceneApi, name: str, text: str, position: Point3 | None, scale: float) -> None:
    """A text in the scene; hidden without a position. scale: of its size."""
    if position is None:
        return _hide(scene, name)
    handle = scene.get_handle_by_name(name)
    if isinstance(handle, viser.LabelHandle):
        handle.text, handle.font_screen_scale = text, scale
        _stand_at(handle, position)
    else:
        scene.add_label(name, text, position=position, anchor="bottom-center", font_screen_scale=scale)


def path(scene: viser.SceneApi, corridor: Path, floor_m: float) -> None:
    """The corridor as a ribbon, with its two sides and a dotted centre line."""
    vertices, faces = outlines.ribbon(corridor, floor_m + 0.02)
    if len(faces):
        scene.add_mesh_simple(
            "/path/ribbon", vertices, faces, color=rgb("path"), opacity=0.18, side="double", flat_shading=True,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
    else:
        _hide(scene, "/path/ribbon")
    sides = [_segments(outlines.on_ground(line, floor_m + 0.04)) for line in (corridor.left, corridor.right)]
    middle = _segments(outlines.on_ground(corridor.center, floor_m + 0.04))[::2]
    parts = [part for part in (*sides, middle) if len(part)]
    lines(scene, "/path/lines", Strokes(parts, [rgb("path")] * len(parts)), 2.0)


def floor(scene: viser.SceneApi, floor_m: float) -> None:
    """A grid of ten-metre squares and the ego car, at this frame's ground height."""
    at: Point3 = (60.0, 0.0, floor_m - 0.02)
    ego = outlines.ego_cuboid(floor_m)
    grid, car = scene.get_handle_by_name("/grid"), scene.get_handle_by_name("/ego")
    if grid is not None and car is not None:
        _stand_at(grid, at)
        _stand_at(car, ego.center)
        return
    scene.add_grid(
        "/grid", 200.0, 200.0, cell_size=2.0, section_size=10.0, cell_thickness=0.5, section_thickness=1.0,
        cell_color=rgb("grid"), section_color=rgb("grid"), position=at, fade_distance=150.0, shadow_opacity=0.0,
    )  # fmt: skip
    scene.add_box(
        "/ego", rgb("ego"), ego.size, opacity=0.5, position=ego.center, cast_shadow=False, receive_shadow=False
    )


def camera_position(frame: Frame) -> Point3:
    """Position of the camera in the ego frame; the ego origin if it is unknown."""
    if frame.camera is None:
        return 0.0, 0.0, 0.0
    x, y, z = inverse(frame.camera.T_camera_ego)[:3, 3]
    return float(x), float(y), float(z)


def image(scene: viser.SceneApi, frame: Frame, wanted: bool) -> None:
    """The camera image in its frustum, with the field of view of K. Distortion is not removed."""
    if not wanted or frame.image is None or frame.camera is None:
        _hide(scene, "/camera/image")
        return _hide(scene, "/camera/edges")
    K, T_ego_camera = frame.camera.K, inverse(frame.camera.T_camera_ego)
    height, width = frame.image.bgr.shape[:2]
    pixels = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height], [width / 2, height / 2]])
    flat = (pixels - K[:2, 2]) / [K[0, 0], K[1, 1]] * _IMAGE_DISTANCE_M
    *corners, middle = transform(T_ego_camera, np.column_stack([flat, np.full(5, _IMAGE_DISTANCE_M)]))
    small = cv2.resize(
        frame.image.bgr, (_IMAGE_WIDTH_PX, max(1, round(_IMAGE_WIDTH_PX * height / width))),
        interpolation=cv2.INTER_AREA,
    )  # fmt: skip
    scene.add_image(
        "/camera/image",
        cv2.cvtColor(small, cv2.COLOR_BGR2RGB),
        width / K[0, 0] * _IMAGE_DISTANCE_M,
        height / K[1, 1] * _IMAGE_DISTANCE_M,
        format="jpeg",
        jpeg_quality=75,
        wxyz=viser.transforms.SO3.from_matrix(T_ego_camera[:3, :3]).wxyz,
        position=middle,
        cast_shadow=False,
        receive_shadow=False,
    )
    ring = np.asarray(corners)
    eye = np.asarray(camera_position(frame))
    rays = np.stack([np.broadcast_to(eye, ring.shape), ring], axis=1)
    frame_lines = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
    lines(scene, "/camera/edges", Strokes([rays, frame_lines], [rgb("vision")] * 2), 1.0)


def _linear(colors: Sequence[Rgb]) -> outlines.U8:
    """sRGB to linear light: the client interprets the colours of line ends as linear and would otherwise show them too
    pale."""
    level = np.asarray(colors, dtype=np.float64) / 255.0
    light = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    return np.rint(light * 255.0).astype(np.uint8)


def _segments(line: F64) -> F64:
    """(K, 3) polyline as (K−1, 2, 3) segments."""
    return np.stack([line[:-1], line[1:]], axis=1)


def _stand_at(handle: viser.SceneNodeHandle, position: Point3) -> None:
    """Move a node: this costs a tenth of creating it again."""
    handle.position = position
    handle.visible = True


def _hide(scene: viser.SceneApi, name: str) -> None:
    handle = scene.get_handle_by_name(name)
    if handle is not None:
        handle.visible = False
