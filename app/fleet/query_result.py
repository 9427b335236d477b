"""What a query on a batch's tables is about, and what it finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

QueryTable = Literal["events", "frames", "objects", "drives"]


@dataclass(frozen=True)
class QueryResult:
    """The result of a query."""

    columns: tuple[str, ...]
    """Names, in the order of each row's values."""
    rows: tuple[tuple[Any, ...], ...]
    """Limited to the requested number; None: unknown."""
    total: int
    """Total number of matching rows."""
