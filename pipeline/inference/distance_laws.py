"""Distance laws fitted for a network, in a file next to it: ``best.onnx`` has ``best.law.json``.

The file contains the network's SHA-256, so a law is never used with other weights than those it was fitted to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.data_dir import file_sha256
from pipeline.common.files.whole_files import replace_text
from pipeline.types import DistanceLaw


@dataclass(frozen=True)
class FoundLaw:
    """Result of looking for a law beside a network."""

    law: DistanceLaw | None
    """Its distance law; None if none was measured, or it cannot be used."""
    note: str = ""
    """Why an existing law is not used; else empty."""


def law_file(network: Path) -> Path:
    """Path of a network's law; the file need not exist."""
    return network.with_suffix(".law.json")


def find_law(network: Path) -> FoundLaw:
    """The law measured for exactly these weights."""
    path = law_file(network)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        law = DistanceLaw(**{each.name: float(kept["law"][each.name]) for each in fields(DistanceLaw)})
        fitted_to = str(kept["network_sha256"])
    except FileNotFoundError:
        return FoundLaw(None)
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return FoundLaw(
            None, f"{path.name} is damaged and was ignored; fit the law again with `cipv calibrate distance`"
        )
    if not _is_possible(law):
        return FoundLaw(None, f"{path.name} holds implausible numbers and was ignored")
    if fitted_to != file_sha256(network):
        return FoundLaw(None, f"{path.name} was fitted to other weights and was ignored")
    return FoundLaw(law)


def keep_law(network: Path, law: DistanceLaw, fitted: Mapping[str, Any]) -> Path:
    """Write a network's law. fitted: data and quality of the fit, for information; plain JSON values.

    BadInput if the file cannot be written.
    """
    path = law_file(network)
    text = json.dumps(
        {"network_sha256": file_sha256(network), "law": asdict(law), "fitted": dict(fitted)},
        indent=1,
        ensure_ascii=False,
    )
    try:
        replace_text(path, text + "\n")
    except OSError as error:
        raise BadInput(
            f"{path} cannot be written ({error.strerror or error}); register the network, and fit the law to that"
        ) from None
    return path


def _is_possible(law: DistanceLaw) -> bool:
    """Whether a taller box means a nearer vehicle, and all numbers are plausible for a camera."""
    sizes = (law.coefficient, law.focal_px, law.truck_ratio, law.bus_ratio, law.motorcycle_ratio)
    return all(math.isfinite(size) and size > 0.0 for size in sizes) and -10.0 < law.exponent < 0.0
