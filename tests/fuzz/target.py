"""What the fuzzer tries: one parser, with inputs that it reads well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.common.errors import BadInput
from pipeline.common.image_decoding import TooMuch
from pipeline.recording.errors import Damaged
from pipeline.sources.live.devices.device_reader import DeviceLost
from pipeline.sources.live.devices.mjpeg import NotMjpeg

Refused = (BadInput, Damaged, TooMuch, ValueError, DeviceLost, NotMjpeg)
"""ValueError: of the parsers inside, whose callers turn it into a sentence."""


@dataclass(frozen=True)
class Target:
    """One parser. It takes any bytes, and returns or raises ``Refused``; everything else is a finding."""

    seeds: tuple[bytes, ...]
    """Inputs that it reads well."""
    read: Callable[[bytes], object]
    """What it does with any."""
    weight: float = 1.0
    """Its share of a run, beside the others'."""
