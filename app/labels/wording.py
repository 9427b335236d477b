"""Texts about labels for people. Frames are counted from 1, as on the page and its timeline; numbers in requests,
responses and files count from 0."""

from __future__ import annotations

from pipeline.labels.model import Lead

WORKING = "working"
"""Name of the current labels, as opposed to frozen versions."""


def frames_text(first: int, last: int | None = None) -> str:
    """``frame 28``, or ``frames 28–39``. first, last: indices, both included."""
    return f"frame {first + 1}" if last is None or first == last else f"frames {first + 1}–{last + 1}"


def outside_text(first: int, last: int, count: int) -> str:
    """Message for frames outside a recording of ``count`` frames."""
    return f"{frames_text(first, last)}: the recording has {count}"


def lead_text(lead: Lead) -> str:
    """A lead as text: the id of its track, "none" or "unclear"."""
    return f"#{lead}" if isinstance(lead, int) else {"none": "none", "unknown": "unclear"}[lead]
