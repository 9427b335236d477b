"""The part of ASAM OpenLABEL 1.0's JSON schema that labels are read from; everything else in a file is ignored."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field


class FileValue(BaseModel):
    """One named attribute."""

    name: str = ""
    """Which attribute this is, such as ``origin``."""
    val: Any = None
    """Text, number or boolean, by the list that it stands in."""
    coordinate_system: str = ""
    """Unused for plain values."""


class FileShape(BaseModel):
    """One named geometry."""

    val: list[float]
    """Cuboid: centre, rotation and size as 9 or 10 numbers. Box: centre and size in pixels. Polyline: x, y, z in
    turn."""
    name: str = ""
    """Of the geometry; unique within its object."""
    coordinate_system: str = ""
    """In which ``val`` is given; empty for the file's default."""


class Data(BaseModel):
    """Attributes and geometries of an element."""

    text: list[FileValue] = Field(default_factory=list)
    """Attributes with strings."""
    num: list[FileValue] = Field(default_factory=list)
    """Attributes with numbers."""
    boolean: list[FileValue] = Field(default_factory=list)
    """Attributes that are true or false."""
    cuboid: list[FileShape] = Field(default_factory=list)
    """3D boxes."""
    bbox: list[FileShape] = Field(default_factory=list)
    """Boxes in an image."""
    poly3d: list[FileShape] = Field(default_factory=list)
    """Polylines, such as the ego lane's borders."""

    def said(self, name: str) -> Any:
        """The value of an attribute by its name; None where the file does not give it."""
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
    """What kind of element ``uid`` refers to."""
    uid: str
    """Key of the element in the file."""


class Element(BaseModel):
    """An object, action, event, context or relation over the whole file."""

    name: str = ""
    """For people to read; elements are identified by their key."""
    type: str = ""
    """Class of an object, or what an action, event, context or relation says."""
    frame_intervals: list[FileInterval] = Field(default_factory=list)
    """When it holds; empty for the whole file."""
    object_data: Data = Field(default_factory=Data)
    """Attributes and geometry of an object that hold in all its frames."""
    action_data: Data = Field(default_factory=Data)
    """Attributes of an action."""
    event_data: Data = Field(default_factory=Data)
    """Attributes of an event."""
    context_data: Data = Field(default_factory=Data)
    """Attributes of a context."""
    rdf_subjects: list[Agent] = Field(default_factory=list)
    """Whom a relation is said of."""
    rdf_objects: list[Agent] = Field(default_factory=list)
    """To whom it relates them."""


class InFrame(BaseModel):
    """An object in one frame."""

    object_data: Data = Field(default_factory=Data)
    """What holds of the object in this frame alone."""


class FileProperties(BaseModel):
    """What a file says of a frame itself."""

    timestamp: str | float | None = None
    """Text or seconds, as the writer chose; None where frames are only numbered."""


class FileFrame(BaseModel):
    """One frame of the file."""

    objects: dict[str, InFrame] = Field(default_factory=dict)
    """What each object is in this frame, by the object's key."""
    frame_properties: FileProperties = Field(default_factory=FileProperties)
    """Of the frame as a whole."""


class FilePose(BaseModel):
    """Where a coordinate system is in its parent."""

    matrix4x4: list[float] | None = None
    """16 numbers, row by row: takes points of the system to its parent."""


class System(BaseModel):
    """A coordinate system, such as the ego frame or a camera."""

    parent: str = ""
    """Name of the system that the pose refers to; empty for the root."""
    pose_wrt_parent: FilePose | None = None
    """None where the system has none, or moves."""


class FileContent(BaseModel):
    """Everything below the root of the file."""

    metadata: dict[str, Any]
    """Version of the schema and where the file comes from."""
    objects: dict[str, Element] = Field(default_factory=dict)
    """Tracks, by key."""
    actions: dict[str, Element] = Field(default_factory=dict)
    """What somebody does over some frames, by key."""
    relations: dict[str, Element] = Field(default_factory=dict)
    """Who leads, among others, by key."""
    events: dict[str, Element] = Field(default_factory=dict)
    """What happens at a moment, by key."""
    contexts: dict[str, Element] = Field(default_factory=dict)
    """Words about ranges of frames, by key."""
    frames: dict[str, FileFrame] = Field(default_factory=dict)
    """By frame number, as text."""
    coordinate_systems: dict[str, System] = Field(default_factory=dict)
    """By name."""


class File(BaseModel):
    """A whole file."""

    openlabel: FileContent
    """The root that the standard demands."""
