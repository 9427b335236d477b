"""Contents of calibration files, wherever they come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.types.source import SourceError

CalibrationFiles = Mapping[str, bytes]
"""Contents by file name."""


def the_file(files: CalibrationFiles) -> tuple[str, bytes]:
    """Name and content of a calibration of one file."""
    ((name, data),) = files.items()
    return name, data


def yaml_mapping(files: CalibrationFiles, name: str) -> dict[str, Any]:
    """The values of one of the files. SourceError if it is missing, or not YAML with names."""
    if name not in files:
        raise SourceError(f"{name}: no such file")
    try:
        loaded = parse_yaml(files[name].decode("utf-8"), name, SourceError)
    except UnicodeDecodeError:
        raise SourceError(f"{name}: not YAML: not a text file") from None
    if not isinstance(loaded, dict):
        raise SourceError(f"{name}: expected names with values")
    return loaded
