"""Labels as viewers draw them: ``foxglove.SceneUpdate`` and ``foxglove.ImageAnnotations``, one message of each per
frame.

They are for viewers only; the label file next to them holds what they cannot express.
"""

from __future__ import annotations

from typing import Any

from pipeline.labels.model import LabelSet, LabelTrack, Sighting
from pipeline.recording import topics
from pipeline.recording.drawn_labels import Drawn
from pipeline.recording.session.messages import stamp, to_bytes
from pipeline.recording.session.scene_update import box_entity, rgba, scene_message

_LEAD_COLOR = "#4ade80"
_STATE_COLOR = {"proposed": "#fbbf24", "accepted": "#60a5fa", "corrected": "#60a5fa"}
_LINE_LOOP = 2
_THICK_PX, _TEXT_PX = 2.0, 14.0


def drawn(labels: LabelSet) -> dict[int, list[Drawn]]:
    """By frame, from the first labelled frame to the one after the last, which clears the view. Rejected labels are not
    drawn. labels: including their boxes."""
    by_frame: dict[int, list[tuple[LabelTrack, Sighting]]] = {}
    for track in labels.tracks:
        if track.state != "rejected":
            for each in track.sightings:
                by_frame.setdefault(each.frame, []).append((track, each))
    if not by_frame:
        return {}
    leads = {
        frame: each.lead
        for each in labels.leads
        if each.state != "rejected"
        for frame in range(each.first, each.last + 1)
    }
    frames = range(min(by_frame), min(max(by_frame) + 2, len(labels.frames)))
    return {
        frame: [
            Drawn(topics.LABEL_SCENE, _scene(by_frame.get(frame, []), leads.get(frame), labels.t_ns[frame])),
            Drawn(topics.LABEL_IMAGE, _annotations(by_frame.get(frame, []), leads.get(frame), labels.t_ns[frame])),
        ]
        for frame in frames
    }


def _scene(seen: list[tuple[LabelTrack, Sighting]], lead: object, t_ns: int) -> bytes:
    entities = [
        box_entity(
            str(track.id),
            (list(each.cuboid.center), list(each.cuboid.size), each.cuboid.yaw_rad),
            _color(track, lead),
            _name(track, lead),
            t_ns,
        )
        for track, each in seen
        if each.cuboid is not None
    ]
    return scene_message(topics.LABEL_SCENE, entities, t_ns)


def _annotations(seen: list[tuple[LabelTrack, Sighting]], lead: object, t_ns: int) -> bytes:
    points: list[dict[str, Any]] = []
    texts: list[dict[str, Any]] = []
    for track, each in seen:
        if each.bbox is None:
            continue
        x1, y1, x2, y2 = each.bbox
        color = rgba(_color(track, lead), 1.0)
        corners = ((x1, y1), (x2, y1), (x2, y2), (x1, y2))
        points.append(
            {
                "timestamp": stamp(t_ns),
                "type": _LINE_LOOP,
                "points": [{"x": x, "y": y} for x, y in corners],
                "outline_color": color,
                "thickness": _THICK_PX,
            }
        )
        texts.append(
            {
                "timestamp": stamp(t_ns),
                "position": {"x": x1, "y": y1},
                "text": _name(track, lead),
                "font_size": _TEXT_PX,
                "text_color": color,
                "background_color": rgba("#000000", 0.5),
            }
        )
    return to_bytes(topics.message_class(topics.LABEL_IMAGE)(points=points, texts=texts))


def _name(track: LabelTrack, lead: object) -> str:
    return f"{'lead ' if track.id == lead else ''}#{track.id} {track.label}, {track.state}"


def _color(track: LabelTrack, lead: object) -> str:
    return _LEAD_COLOR if track.id == lead else _STATE_COLOR.get(track.state, _STATE_COLOR["accepted"])
