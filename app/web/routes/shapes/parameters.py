"""The parameters and their values, as types."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict

from app.web.routes.shapes.common import ApiModel, Exact


class ParamJson(ApiModel):
    """One parameter."""

    model_config = ConfigDict(extra="forbid")

    key: str
    """Name within its section."""
    help: str
    """What it does, in a sentence."""
    kind: Literal["number", "integer", "boolean", "choice"]
    """Of its values."""
    nullable: bool
    """Whether null is a value: the calibration's or the detector's own."""
    min: float | None = None
    """Of numbers."""
    max: float | None = None
    """Of numbers."""
    step: float | None = None
    """Of a slider for it."""
    unit: str | None = None
    """Of numbers; null for none."""
    choices: list[str] | None = None
    """Of a choice, in order."""


class ParamSectionJson(Exact):
    """Parameters of one stage, in the order in which they are declared."""

    name: str
    """First part of its parameters' dotted names."""
    help: str
    """What the stage does."""
    params: list[ParamJson]
    """In the order in which they are declared."""


class ParamsJson(Exact):
    """The parameters and their values, by dotted name."""

    preset: str
    """That the values started from."""
    presets: list[str]
    """Names of all presets."""
    revision: int
    """Grows with every change."""
    can_undo: bool
    """Of the person who asks, or of steps that nobody put a name to."""
    can_redo: bool
    """As ``can_undo``."""
    sections: list[ParamSectionJson]
    """What parameters there are."""
    values: dict[str, float | str | bool | None]
    """In use."""
    base: dict[str, float | str | bool | None]
    """The preset's."""
    effective: dict[str, float]
    """What null stands for with the shown camera and the detector in use."""
