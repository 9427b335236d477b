"""The part of ASAM OpenLABEL 1.0's JSON schema that labels are read from; anything else in a file is passed over."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field


class Value(BaseModel):
    name: str = ""
    val: Any = None
    coordinate_system: str = ""


class Shape(BaseModel):
    val: list[float]
    name: str = ""
    coordinate_system: str = ""


class Data(BaseModel):
    text: list[Value] = Field(default_factory=list)
    num: list[Value] = Field(default_factory=list)
    boolean: list[Value] = Field(default_factory=list)
    cuboid: list[Shape] = Field(default_factory=list)
    bbox: list[Shape] = Field(default_factory=list)
    poly3d: list[Shape] = Field(default_factory=list)

    def said(self, name: str) -> Any:
        return next((each.val for each in (*self.text, *self.num, *self.boolean) if each.name == name), None)


class Interval(BaseModel):
    frame_start: int
    frame_end: int


class Agent(BaseModel):
    type: str = "object"
    uid: str


class Element(BaseModel):
    name: str = ""
    type: str = ""
    frame_intervals: list[Interval] = Field(default_factory=list)
    object_data: Data = Field(default_factory=Data)
    action_data: Data = Field(default_factory=Data)
    event_data: Data = Field(default_factory=Data)
    context_data: Data = Field(default_factory=Data)
    rdf_subjects: list[Agent] = Field(default_factory=list)
    rdf_objects: list[Agent] = Field(default_factory=list)


class InFrame(BaseModel):
    object_data: Data = Field(default_factory=Data)


class Properties(BaseModel):
    timestamp: str | float | None = None


class Frame(BaseModel):
    objects: dict[str, InFrame] = Field(default_factory=dict)
    frame_properties: Properties = Field(default_factory=Properties)


class Pose(BaseModel):
    matrix4x4: list[float] | None = None


class System(BaseModel):
    parent: str = ""
    pose_wrt_parent: Pose | None = None


class Content(BaseModel):
    metadata: dict[str, Any]
    objects: dict[str, Element] = Field(default_factory=dict)
    actions: dict[str, Element] = Field(default_factory=dict)
    relations: dict[str, Element] = Field(default_factory=dict)
    events: dict[str, Element] = Field(default_factory=dict)
    contexts: dict[str, Element] = Field(default_factory=dict)
    frames: dict[str, Frame] = Field(default_factory=dict)
    coordinate_systems: dict[str, System] = Field(default_factory=dict)


class File(BaseModel):
    openlabel: Content
