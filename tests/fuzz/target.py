"""A target of the fuzzer: one parser, with valid inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.common.errors import BadInput
from pipeline.common.files.image_decoding import TooMuch
from pipeline.recording.errors import Damaged
from pipeline.sources.live.devices.device_reader import DeviceLost
from pipeline.sources.live.devices.mjpeg import NotMjpeg

Refused = (BadInput, Damaged, TooMuch, ValueError, DeviceLost, NotMjpeg)
"""Permitted exceptions. ValueError comes from inner parsers, whose callers turn it into a sentence."""


@dataclass(frozen=True)
class Target:
    """One parser. For any bytes, it must return or raise ``Refused``; everything else is a finding."""

    seeds: tuple[bytes, ...]
    """Valid inputs."""
    read: Callable[[bytes], object]
    """Parses an input."""
    weight: float = 1.0
    """Its share of a run, relative to the other targets."""
