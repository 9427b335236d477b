"""Contents of calibration files, wherever they come from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.types.source import SourceError

CalibrationFiles = Mapping[str, bytes]
"""Contents by file name."""

_VERSION = "%YAML:1.0"
"""First line of OpenCV's files, and of those that OpenVINS reads; not a valid YAML directive."""
_END = re.compile(r"(^---\s*)+\Z", re.MULTILINE)
"""End of what ``ros2 topic echo`` prints."""


def the_file(files: CalibrationFiles) -> tuple[str, bytes]:
    """Name and content of a calibration of one file."""
    ((name, data),) = files.items()
    return name, data


def plain_yaml(text: str) -> str:
    """The document without what tools write around it and YAML does not have."""
    return _END.sub("", text.strip().removeprefix(_VERSION))


def yaml_mapping(files: CalibrationFiles, name: str) -> dict[str, Any]:
    """The values of one of the files. SourceError if it is missing, or not YAML with names."""
    if name not in files:
        raise SourceError(f"{name}: no such file")
    try:
        loaded = parse_yaml(plain_yaml(files[name].decode("utf-8")), name, SourceError)
    except UnicodeDecodeError:
        raise SourceError(f"{name}: not YAML: not a text file") from None
    if not isinstance(loaded, dict):
        raise SourceError(f"{name}: expected names with values")
    return loaded
