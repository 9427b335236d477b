"""Types shared by the responses of several routes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.types import object_sources

SensorLetters = Annotated[str, Field(json_schema_extra={"enum": list(object_sources())})]
Point = tuple[float, float]


def file_of(media_type: str) -> dict[int | str, dict[str, Any]]:
    """OpenAPI description of a response that is a file."""
    return {200: {"content": {media_type: {}}, "description": "The file"}}


class ApiModel(BaseModel):
    """Base of models in OpenAPI: the docstring of each field becomes its description there."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class Exact(ApiModel):
    """A model without additional keys."""

    model_config = ConfigDict(extra="forbid")


class StatusJson(Exact):
    """An answer without content."""

    status: str
    """What became of the request."""


class Refusal(Exact):
    """Why a request was refused."""

    detail: str
    """One sentence."""


class CuboidJson(Exact):
    """A cuboid in the ego frame, metres."""

    center: tuple[float, float, float]
    """x, y, z of its middle."""
    size: tuple[float, float, float]
    """Length, width, height."""
    yaw_rad: float
    """Heading, positive to the left of ego x."""


class MetricJson(ApiModel):
    """One figure of two runs."""

    name: str
    """For people."""
    unit: str
    """Empty for counts."""
    base: float | None
    """Of the run compared with; null where it is undefined."""
    run: float | None
    """Of the run itself; null where it is undefined."""
    better: Literal["higher", "lower"] | None
    """Which direction is good; null where neither is."""
