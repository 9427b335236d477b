"""The Velodynes whose packets are read: 1206 bytes of twelve blocks, which differ in how many lasers fire in a block
and how long that takes (manuals 63-9243 of the VLP-16, 63-9113 of the HDL-32E, 63-9325 of the VLP-32C)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice

PACKET_BYTES = 1206
_PRODUCT = 1205
"""Offset of the product's byte in a packet."""
_LOOK_AT = 200
"""Packets that decide what the sensor is."""


@dataclass(frozen=True)
class VelodyneModel:
    """What a model's packets are."""

    name: str
    """As the maker calls it."""
    product: int
    """The last byte of its packets."""
    block_us: float
    """Time that the lasers of one block take, a block's share of the head's turn."""
    channels: int
    """How many lasers it has."""
    library: str
    """The model's name in velodyne-decoder."""


VLP16 = VelodyneModel("VLP-16", 0x22, 110.592, 16, "VLP16")
PUCK_HI_RES = VelodyneModel("Puck Hi-Res", 0x24, 110.592, 16, "PuckHiRes")
HDL32E = VelodyneModel("HDL-32E", 0x21, 46.08, 32, "HDL32E")
VLP32C = VelodyneModel("VLP-32C", 0x28, 55.296, 32, "VLP32C")
MODELS = (VLP16, PUCK_HI_RES, HDL32E, VLP32C)
"""Those that are read."""


def model_of(packets: Iterable[bytes]) -> VelodyneModel:
    """The model that most of the first packets are of; a VLP-16 where they are of none that is read."""
    whole = (packet for packet in islice(packets, _LOOK_AT) if len(packet) == PACKET_BYTES)
    products = Counter(packet[_PRODUCT] for packet in whole if packet[:2] == b"\xff\xee")
    return max(MODELS, key=lambda model: products[model.product])


def about_other_models(seen: Mapping[str, int]) -> str:
    """Of packets of models that are not read, by model: which, and which are."""
    return f"packets of a Velodyne {max(seen, key=seen.__getitem__)}; {about_supported_models()}"


def about_supported_models() -> str:
    """Which models are read."""
    return f"only {', '.join(model.name for model in MODELS)} are supported"
