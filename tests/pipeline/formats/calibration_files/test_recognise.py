"""Files of a calibration are recognised by their content, whatever they are called."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.formats.calibration_files import FORMATS
from pipeline.formats.calibration_files.recognise import parse_any
from pipeline.types.source import SourceError
from tests.pipeline.formats.calibration_files.test_calibration_files import STRAIGHT, same, written

SIZE = STRAIGHT.width, STRAIGHT.height


def contents(name: str, folder: Path) -> dict[str, bytes]:
    """The files of a format, under names that say nothing."""
    path = written(name, STRAIGHT, folder / name)
    files = [path] if path.is_file() else sorted(path.iterdir())
    return {f"{name} {number}": file.read_bytes() for number, file in enumerate(files)}


@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_every_format_is_recognised(name: str, tmp_path: Path):
    found, camera = parse_any(contents(name, tmp_path), SIZE)
    assert found is FORMATS[name]
    same(camera, STRAIGHT)


def test_what_is_missing_or_mixed_up_is_named(tmp_path: Path):
    kitti, ros, rig = (contents(name, tmp_path) for name in ("kitti", "ros", "rig"))
    info, transform = ({name: data} for name, data in ros.items())
    for files, named in (
        (info, "the static transform is missing: ROS needs two files"),
        (transform, "the camera info is missing"),
        ({**transform, "again": next(iter(transform.values()))}, "again: the static transform is given twice"),
        ({**kitti, **ros}, "files of KITTI and ROS: give those of one"),
        ({**kitti, "b": next(iter(kitti.values()))}, "2 files of KITTI: give one"),
        (rig, "rig 0: a rig file describes a recording"),
        ({"notes.txt": b"hello"}, "notes.txt: not a calibration of KITTI, ROS, OpenCV or Kalibr"),
        ({}, "no file is given"),
    ):
        with pytest.raises(SourceError, match=named):
            parse_any(files, SIZE)
