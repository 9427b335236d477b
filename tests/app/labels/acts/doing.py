"""Acts in the form that the API takes, and what has come of them."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from app.labels.acts.registry import do
from app.labels.acts.requests import Act
from app.labels.acts.scope import Scope
from app.labels.store.act_log import Acted
from app.labels.store.drive_labels import DriveLabels
from pipeline.labels.model import LabelTrack

ACT: TypeAdapter[Any] = TypeAdapter(Act)
BOX = {"center": [20.0, 0.0, 0.7], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.0}


def act(labels: DriveLabels, person: str = "Ada", **body: Any) -> Acted:
    """A bare ``track`` or item gets its current revision."""
    if "track" in body:
        body.setdefault("revision", labels.track(body["track"]).revision)
    if "items" in body:
        body["items"] = [
            {"kind": kind, "id": number, "revision": labels.items(kind)[number].revision}
            for kind, number in body["items"]
        ]
    doing = ACT.validate_python(body)
    return labels.log.act(doing.kind, person, lambda draft: do(draft, Scope(labels.info.t_ns), doing))


def track(labels: DriveLabels, number: int = 1) -> LabelTrack:
    found = labels.track(number).value
    assert isinstance(found, LabelTrack)
    return found


def leads(labels: DriveLabels) -> list[tuple[int, int, int | str, str]]:
    ranges = [item.value for item in labels.items("lead").values()]
    return sorted((each.first, each.last, each.lead, each.state) for each in ranges)  # type: ignore[union-attr]
