"""The names in a registry as an API type: OpenAPI lists them, and other names are rejected."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import AfterValidator, WithJsonSchema
from pydantic_core import PydanticCustomError


def one_of(names: Iterable[str]) -> tuple[Any, Any]:
    """For ``Annotated[str, *one_of(REGISTRY)]``: the equivalent of a ``Literal`` for names that are only known at
    runtime."""
    known = list(names)

    def check(name: str) -> str:
        if name not in known:
            listed = ", ".join(f"'{each}'" for each in known)
            raise PydanticCustomError("literal_error", "Input should be {listed}", {"listed": listed})
        return name

    return AfterValidator(check), WithJsonSchema({"type": "string", "enum": known})
