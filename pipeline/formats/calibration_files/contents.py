"""Contents of calibration files, wherever they come from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.types.source import SourceError


class GivenFile(NamedTuple):
    """One file of a calibration."""

    name: str
    """Its own, for errors."""
    data: bytes
    """Its content."""


CalibrationFiles = Mapping[str, GivenFile]
"""By the names that their format has for them, whatever they are called; by any name for a format of one file."""

_VERSION = "%YAML:1.0"
"""First line of OpenCV's files, and of those that OpenVINS reads; not a valid YAML directive."""
_END = re.compile(r"(^---\s*)+\Z", re.MULTILINE)
"""End of what ``ros2 topic echo`` prints."""


def the_file(files: CalibrationFiles) -> GivenFile:
    """That of a calibration of one file."""
    (file,) = files.values()
    return file


def plain_yaml(text: str) -> str:
    """The document without what tools write around it and YAML does not have."""
    return _END.sub("", text.strip().removeprefix(_VERSION))


def file_of(files: CalibrationFiles, part: str) -> GivenFile:
    """One of several files, by its format's name for it. SourceError if it is missing."""
    if part not in files:
        raise SourceError(f"{part}: no such file")
    return files[part]


def yaml_mapping(file: GivenFile) -> dict[str, Any]:
    """The values of a file. SourceError if it is not YAML with names."""
    name, data = file
    try:
        loaded = parse_yaml(plain_yaml(data.decode("utf-8")), name, SourceError)
    except UnicodeDecodeError:
        raise SourceError(f"{name}: not YAML: not a text file") from None
    if not isinstance(loaded, dict):
        raise SourceError(f"{name}: expected names with values")
    return loaded
