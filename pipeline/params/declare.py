"""Declaring a parameter: its default, bounds, step, unit and description."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


def slider(default: float | int | None, low: float, high: float, step: float, unit: str, text: str) -> Any:
    """A number between two bounds, shown as a slider. text: what it does, for the page and the command line."""
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"step": step, "unit": unit})


def choice(default: Any, text: str) -> Any:
    """One of a few values, or a switch. text: what it does, for the page and the command line."""
    return Field(default, description=text)


class Section(BaseModel):
    """The parameters of one stage. Frozen; unknown names and numbers that are not finite are rejected."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
