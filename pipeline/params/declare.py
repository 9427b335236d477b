"""How a parameter is declared: default, bounds, step, unit and what it does, once."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


def slider(default: float | int | None, low: float, high: float, step: float, unit: str, text: str) -> Any:
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"step": step, "unit": unit})


def choice(default: Any, text: str) -> Any:
    return Field(default, description=text)


class Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
