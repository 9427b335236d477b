"""Acts on a drive's labels, as tests of the log do them."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from app.core.request_shapes import CuboidShape
from app.labels.acts.registry import do
from app.labels.acts.requests import Act, AddTrack, Relabel
from app.labels.acts.scope import Scope
from app.labels.store.act_log import Acted
from app.labels.store.drive_labels import DriveLabels
from pipeline.labels.model import LabelSet

ACT: TypeAdapter[Any] = TypeAdapter(Act)


def cuboid(x: float = 20.0) -> CuboidShape:
    return CuboidShape(center=(x, 0.0, 0.7), size=(4.0, 1.8, 1.5), yaw_rad=0.0)


def act(labels: DriveLabels, person: str, doing: object) -> Acted:
    kind: str = doing.kind  # type: ignore[attr-defined]
    return labels.log.act(kind, person, lambda draft: do(draft, Scope(labels.info.t_ns), doing))


def add(labels: DriveLabels, person: str = "Ada", x: float = 20.0) -> int:
    """Add a track; returns its id."""
    before = set(labels.items("track"))
    act(labels, person, AddTrack(kind="add_track", label="car", frame=10, cuboid=cuboid(x)))
    (number,) = set(labels.items("track")) - before
    return number


def relabel(labels: DriveLabels, track: int, label: str, person: str = "Ada") -> Acted:
    revision = labels.track(track).revision
    return act(labels, person, Relabel(kind="relabel", track=track, revision=revision, label=label))


def shown(labels: DriveLabels) -> LabelSet:
    return labels.label_set()


def label_of(labels: DriveLabels, track: int) -> str:
    return labels.track(track).value.label  # type: ignore[union-attr]
