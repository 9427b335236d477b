"""Messages of a page about its 3D view: its name, its selection, the labels to draw and the label being edited."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.core.request_shapes import CuboidShape
from app.core.shared_view_state import HeldCuboid, LabelInView, LabelRole, LabelsInView, SharedViewState

_NAME = re.compile(r"[0-9a-f]{16,64}")
_MOST_LABELS = 200
_Number = Annotated[int, Field(ge=0, lt=2**53)]


class _Held(BaseModel):
    """A label that can be dragged."""

    track: _Number
    frame: _Number
    cuboid: CuboidShape


class _Label(BaseModel):
    model_config = ConfigDict(extra="forbid")

    track: _Number
    cuboid: CuboidShape
    text: str = Field(max_length=200)
    role: LabelRole
    facing: bool


class _Labels(BaseModel):
    model_config = ConfigDict(extra="forbid")

    labels: list[_Label] = Field(max_length=_MOST_LABELS)
    alone: bool


def hear(looks: SharedViewState, page: object, said: Mapping[str, Any]) -> None:
    """Apply a page's message about its 3D view. Invalid content counts as nothing held and nothing labelled; other
    fields are ignored."""
    name = said.get("page_3d")
    if isinstance(name, str) and _NAME.fullmatch(name):
        looks.name(page, name)
    if "selected" in said and is_id_or_null(said["selected"]):
        looks.select(page, said["selected"])
    if isinstance(said.get("hides_3d"), bool):
        looks.hide(page, said["hides_3d"])
    if "held" in said:
        _hold(looks, page, said["held"])
    if "labels_3d" in said:
        looks.label(page, _labels(said["labels_3d"]))


def is_id_or_null(value: Any) -> bool:
    """Whether a JSON value is an id that JavaScript can represent exactly, or null."""
    return value is None or (isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53)


def _hold(looks: SharedViewState, page: object, said: Any) -> None:
    try:
        held = _Held.model_validate(said)
    except ValidationError:
        looks.let_go(page)
    else:
        looks.hold(HeldCuboid(page, held.track, held.frame, held.cuboid.value()))


def _labels(said: Any) -> LabelsInView | None:
    try:
        found = _Labels.model_validate(said)
    except ValidationError:
        return None
    labels = (LabelInView(each.track, each.cuboid.value(), each.text, each.role, each.facing) for each in found.labels)
    return LabelsInView(tuple(labels), found.alone)
