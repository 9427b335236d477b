"""Responses of /api/labels about the project's classes, as types."""

from __future__ import annotations

from app.web.routes.shapes.common import ApiModel


class ClassJson(ApiModel):
    """A class of road users."""

    name: str
    """What labels call it."""
    of: str | None
    """The class that it is a kind of; null at the top."""
    size: tuple[float, float, float] | None
    """Usual length, width and height in metres; null for that of its parent."""
    exports: dict[str, str]
    """What label formats call it, by format."""


class AttributeKindJson(ApiModel):
    """An attribute that tracks can have."""

    name: str
    """What labels call it."""
    values: list[str]
    """What it can be."""


class ClassListJson(ApiModel):
    """The classes and attributes of the project."""

    classes: list[ClassJson]
    """In the order in which people choose."""
    attributes: list[AttributeKindJson]
    """In the order in which they are shown."""
