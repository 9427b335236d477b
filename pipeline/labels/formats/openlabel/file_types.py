"""The part of ASAM OpenLABEL 1.0's JSON schema that labels are read from; everything else in a file is ignored."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field


class FileValue(BaseModel):
    """One named attribute."""

    name: str = ""
    """Which attribute this is, such as ``origin``."""
    val: Any = None
    """Text, number or boolean, depending on the list that contains it."""
    coordinate_system: str = ""
    """Unused for plain values."""


class FileShape(BaseModel):
    """One named geometry."""

    val: list[float]
    """Cuboid: centre, rotation and size as 9 or 10 numbers. Box: centre and size in pixels. Polyline: x, y, z
    repeated."""
    name: str = ""
    """Of the geometry; unique within its object."""
    coordinate_system: str = ""
    """Coordinate system of ``val``; empty for the file's default."""


class Data(BaseModel):
    """Attributes and geometries of an element."""

    text: list[FileValue] = Field(default_factory=list)
    """Attributes with strings."""
    num: list[FileValue] = Field(default_factory=list)
    """Attributes with numbers."""
    boolean: list[FileValue] = Field(default_factory=list)
    """Boolean attributes."""
    cuboid: list[FileShape] = Field(default_factory=list)
    """3D boxes."""
    bbox: list[FileShape] = Field(default_factory=list)
    """Boxes in an image."""
    poly3d: list[FileShape] = Field(default_factory=list)
    """Polylines, such as the ego lane's borders."""

    def said(self, name: str) -> Any:
        """The value of an attribute by its name; None if the file does not contain it."""
        return next((each.val for each in (*self.text, *self.num, *self.boolean) if each.name == name), None)


class FileInterval(BaseModel):
    """A range of frames."""

    frame_start: int
    """First frame number."""
    frame_end: int
    """Last frame number, inclusive."""


class Agent(BaseModel):
    """A reference from a relation to an element."""

    type: str = "object"
    """Type of the element with key ``uid``."""
    uid: str
    """Key of the element in the file."""


class Element(BaseModel):
    """An object, action, event, context or relation over the whole file."""

    name: str = ""
    """Display name; elements are identified by their key."""
    type: str = ""
    """Class of an object, or type of an action, event, context or relation."""
    frame_intervals: list[FileInterval] = Field(default_factory=list)
    """When it is valid; empty for the whole file."""
    object_data: Data = Field(default_factory=Data)
    """Attributes and geometry of an object that are valid in all its frames."""
    action_data: Data = Field(default_factory=Data)
    """Attributes of an action."""
    event_data: Data = Field(default_factory=Data)
    """Attributes of an event."""
    context_data: Data = Field(default_factory=Data)
    """Attributes of a context."""
    rdf_subjects: list[Agent] = Field(default_factory=list)
    """Subjects of a relation."""
    rdf_objects: list[Agent] = Field(default_factory=list)
    """Objects of a relation."""


class InFrame(BaseModel):
    """An object in one frame."""

    object_data: Data = Field(default_factory=Data)
    """Attributes and geometry that are valid only in this frame."""


class FileProperties(BaseModel):
    """Properties of a frame."""

    timestamp: str | float | None = None
    """Text or seconds, as the writer chose; None where frames are only numbered."""


class FileFrame(BaseModel):
    """One frame of the file."""

    objects: dict[str, InFrame] = Field(default_factory=dict)
    """Data of each object in this frame, by the object's key."""
    frame_properties: FileProperties = Field(default_factory=FileProperties)
    """Of the frame as a whole."""


class FilePose(BaseModel):
    """Pose of a coordinate system in its parent."""

    matrix4x4: list[float] | None = None
    """16 numbers, row by row: takes points of the system to its parent."""


class System(BaseModel):
    """A coordinate system, such as the ego frame or a camera."""

    parent: str = ""
    """Name of the system that the pose refers to; empty for the root."""
    pose_wrt_parent: FilePose | None = None
    """None if the system has none, or moves."""


class FileContent(BaseModel):
    """Everything below the root of the file."""

    metadata: dict[str, Any]
    """Version of the schema and where the file comes from."""
    objects: dict[str, Element] = Field(default_factory=dict)
    """Tracks, by key."""
    actions: dict[str, Element] = Field(default_factory=dict)
    """Actions over some frames, by key."""
    relations: dict[str, Element] = Field(default_factory=dict)
    """Leads and other relations, by key."""
    events: dict[str, Element] = Field(default_factory=dict)
    """Events at one frame, by key."""
    contexts: dict[str, Element] = Field(default_factory=dict)
    """Tags of ranges of frames, by key."""
    frames: dict[str, FileFrame] = Field(default_factory=dict)
    """By frame number, as text."""
    coordinate_systems: dict[str, System] = Field(default_factory=dict)
    """By name."""


class File(BaseModel):
    """A whole file."""

    openlabel: FileContent
    """The root element required by the standard."""
