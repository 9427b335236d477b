"""Results as boxes in a 3D view: ``foxglove.SceneUpdate``, for viewers only."""

from __future__ import annotations

import math
from typing import Any

from pipeline.recording import topics
from pipeline.recording.session.messages import stamp, to_bytes
from pipeline.types.sensors import are_several, is_camera_in

_DELETE_ALL = 1
_CIPV_COLOR = "#4ade80"
_CAMERA_COLOR, _RANGING_COLOR, _SEVERAL_COLOR = "#22d3ee", "#ff4dd8", "#c4b5fd"
"""Of objects by the sensors that see them, as on the dashboard."""
_OPACITY = 0.45
_FLAT_M = 0.1
"""Height used to draw an object for which only the footprint is known."""


def objects_message(result: dict[str, Any], t_ns: int) -> bytes:
    """The boxes of a result (as JSON, docs/reference/results.md) in the ego frame. They replace those of the previous
    frame."""
    lead = (result.get("cipv") or {}).get("id")
    entities = [
        _entity(each, box, is_lead=each.get("id") == lead, t_ns=t_ns)
        for each in result.get("objects") or ()
        if (box := _box(each)) is not None
    ]
    return scene_message(topics.OBJECTS, entities, t_ns)


def _box(each: dict[str, Any]) -> tuple[list[float], list[float], float] | None:
    """Center, size and yaw; None for an object of unknown position."""
    cuboid, bev = each.get("cuboid"), each.get("bev")
    if cuboid is not None:
        return cuboid["center"], cuboid["size"], cuboid["yaw_rad"]
    if bev is None:
        return None
    front_left, front_right, rear_right, rear_left = bev
    center = [(front_left[axis] + rear_right[axis]) / 2 for axis in (0, 1)]
    size = [math.dist(front_left, rear_left), math.dist(front_left, front_right), _FLAT_M]
    return [*center, 0.0], size, math.atan2(front_left[1] - rear_left[1], front_left[0] - rear_left[0])


def _entity(
    each: dict[str, Any], box: tuple[list[float], list[float], float], *, is_lead: bool, t_ns: int
) -> dict[str, Any]:
    color = _CIPV_COLOR if is_lead else _color_of(each["source"])
    distance = "" if each.get("distance_m") is None else f" {each['distance_m']:.1f} m"
    name = f"{'CIPV ' if is_lead else ''}#{each['id']} {each.get('type') or each['source']}{distance}"
    return box_entity(str(each["id"]), box, color, name, t_ns)


def _color_of(source: str) -> str:
    if are_several(source):
        return _SEVERAL_COLOR
    return _CAMERA_COLOR if is_camera_in(source) else _RANGING_COLOR


def scene_message(topic: str, entities: list[dict[str, Any]], t_ns: int) -> bytes:
    """``foxglove.SceneUpdate`` of these entities, replacing everything that the topic showed before."""
    message = topics.message_class(topic)
    return to_bytes(message(deletions=[{"timestamp": stamp(t_ns), "type": _DELETE_ALL}], entities=entities))


def rgba(color: str, opacity: float) -> dict[str, float]:
    """``foxglove.Color`` of ``#rrggbb``."""
    r, g, b = (int(color[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return {"r": r, "g": g, "b": b, "a": opacity}


def box_entity(
    number: str, box: tuple[list[float], list[float], float], color: str, name: str, t_ns: int
) -> dict[str, Any]:
    """A box with its name above it. box: center, size and yaw in the ego frame. color: ``#rrggbb``."""
    (x, y, z), size, yaw_rad = box
    turned = {"z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
    return {
        "timestamp": stamp(t_ns),
        "frame_id": topics.EGO_FRAME,
        "id": number,
        "cubes": [
            {
                "pose": {"position": {"x": x, "y": y, "z": z}, "orientation": turned},
                "size": dict(zip("xyz", size, strict=True)),
                "color": rgba(color, _OPACITY),
            }
        ],
        "texts": [
            {
                "pose": {"position": {"x": x, "y": y, "z": z + size[2]}, "orientation": {"w": 1.0}},
                "billboard": True,
                "font_size": 12.0,
                "scale_invariant": True,
                "color": {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0},
                "text": name,
            }
        ],
    }
