"""Ranges of frames, both ends included, and how new ranges cut existing ones."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TypeVar

from pipeline.labels.model import FrameTag, LeadRange

S = TypeVar("S", LeadRange, FrameTag)


def free_spans(first: int, last: int, said: Collection[int]) -> list[tuple[int, int]]:
    """The unlabelled parts of a range. said: labelled frames."""
    parts: list[tuple[int, int]] = []
    for frame in range(first, last + 1):
        if frame in said:
            continue
        if parts and parts[-1][1] == frame - 1:
            parts[-1] = (parts[-1][0], frame)
        else:
            parts.append((frame, frame))
    return parts


def outside(span: S, first: int, last: int) -> list[S]:
    """The parts of a range that remain after frames first … last are cut out of it."""
    before = [replace(span, last=first - 1)] if span.first < first else []
    after = [replace(span, first=last + 1)] if span.last > last else []
    return before + after
