"""What requests about labels are made of: numbers, names and words as a person gives them, checked and cleaned."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from app.core.request_shapes import Finite
from app.labels.store.values import LONGEST_NAME

_LARGEST_ID = 2**63 - 1
MOST_FRAMES = 2**31 - 1
_MOST_POINTS = 1000


def _clean(text: str) -> str:
    """One line without what a terminal or page would act on."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _named(text: str) -> str:
    cleaned = _clean(text)
    if not cleaned:
        raise ValueError("a name is needed")
    return cleaned


def _commented(text: str) -> str:
    cleaned = _clean(text)
    if not cleaned:
        raise ValueError("a comment is needed: say what to check")
    return cleaned


Id = Annotated[int, Field(ge=0, le=_LARGEST_ID)]
Index = Annotated[int, Field(ge=0, le=MOST_FRAMES)]
Person = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(_named)]
PersonOrNobody = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(_clean)]
"""Cleaned as ``Person`` is, so that both name the same one; empty for nobody in particular."""
Word = Annotated[str, Field(max_length=40), AfterValidator(_named)]
Comment = Annotated[str, Field(max_length=1000), AfterValidator(_commented)]
Line = Annotated[list[tuple[Finite, Finite]], Field(min_length=2, max_length=_MOST_POINTS)]


class Strict(BaseModel):
    """No key more than is said."""

    model_config = ConfigDict(extra="forbid")
