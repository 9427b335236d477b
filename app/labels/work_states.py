"""The states of a recording in the labeling queue."""

from __future__ import annotations

from typing import Literal

State = Literal["open", "labeling", "review", "done"]
"""open: not started. review: labelled, waiting for a second person's review."""
