"""Anything but a regular file is refused without waiting for it or reading it."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.common.errors import BadInput
from pipeline.common.files import user_files
from pipeline.common.files.user_files import FOLDERS_VARIABLE, Overloaded, open_regular, read_regular
from pipeline.evaluation.scores.results_file import read_results
from pipeline.formats.calibration_files import FORMATS
from pipeline.labels.classes import read_classes
from pipeline.labels.formats.reading import read_bytes
from pipeline.params import Params, from_yaml
from pipeline.sources import open_any, open_source
from pipeline.sources.live.devices.can import load_dbc
from pipeline.sources.route_files import load_route
from tests.pipeline.sources.conftest import write_astyx, write_kitti_raw


def _with_a_track(path: Path) -> None:
    """A folder of images in which this is the only track."""
    for index in range(2):
        cv2.imwrite(str(path.parent / f"{index}.png"), np.zeros((8, 8, 3), np.uint8))
    open_source(f"pictures:{path.parent}")


Opens = Callable[[str], object]
OPENERS: dict[str, tuple[str, Opens]] = {
    "live": (".yaml", lambda path: open_any(f"live:{path}")),
    "scenario": (".yaml", lambda path: open_any(f"sim:{path}")),
    "pcap": (".pcap", lambda path: open_any(f"pcap:{path}")),
    "session": (".mcap", open_any),
    "bag": (".bag", lambda path: open_any(f"rosbag:{path}")),
    "bag of ROS 2": (".db3", lambda path: open_any(f"rosbag:{path}")),
    "folder": ("", lambda path: open_any(f"astyx:{path}")),
    "route": (".gpx", load_route),
    "parameters": (".yaml", lambda path: from_yaml(Path(path), Params())),
    "labels": (".json", lambda path: read_bytes(Path(path))),
    "signals": (".dbc", lambda path: load_dbc(Path(path))),
    "classes": (".yaml", lambda path: read_classes(Path(path))),
    "results": (".jsonl", lambda path: read_results(Path(path))),
    "calibration": (".yaml", lambda path: FORMATS["opencv"].read(Path(path), None)),
    "track beside images": (".gpx", lambda path: _with_a_track(Path(path))),
}


@pytest.mark.timeout(20)
@pytest.mark.parametrize("target", ["pipe", "/dev/zero"])
@pytest.mark.parametrize("name", OPENERS)
def test_a_pipe_and_an_endless_device_are_refused_at_once(tmp_path: Path, name: str, target: str):
    suffix, opens = OPENERS[name]
    path = tmp_path / f"x{suffix}"
    if target == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(target)
    with pytest.raises(BadInput):
        opens(str(path))


@pytest.mark.timeout(20)
def test_a_pipe_among_the_stamps_of_a_folder_is_no_stamp(tmp_path: Path):
    drive = write_kitti_raw(tmp_path / "2011_09_26")
    for name in ("velodyne_points", "image_02"):
        (drive / name / "timestamps.txt").unlink()
        os.mkfifo(drive / name / "timestamps.txt")
    assert open_source(f"kitti:{drive}").frame(0).sweep is not None


def test_a_file_beyond_its_size_is_refused(tmp_path: Path):
    (tmp_path / "x").write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(OSError, match="larger than 1 MiB"):
        read_regular(tmp_path / "x", 1 << 20)


def _bytes_read() -> int:
    """By this process so far."""
    return int(Path("/proc/self/io").read_text().split()[1])


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="what was read is counted by Linux")
def test_nothing_is_read_of_a_file_beyond_its_size(tmp_path: Path):
    with (tmp_path / "x").open("wb") as file:
        file.truncate(4 << 30)  # takes no space on the disk
    before = _bytes_read()
    with pytest.raises(OSError, match="larger than 512 MiB"):
        read_regular(tmp_path / "x", 512 << 20)
    assert _bytes_read() - before < 1 << 20
    with pytest.raises(OSError, match="larger than 0 MiB"):
        read_regular(Path("/proc/self/status"), 10)  # which has no size


def test_outside_the_allowed_folders_nothing_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    inside, outside = tmp_path / "drives", tmp_path / "else"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "a.yaml").write_text("title: a\n")
    (inside / "link.yaml").symlink_to(outside / "a.yaml")
    monkeypatch.setenv(FOLDERS_VARIABLE, str(inside))
    assert read_regular(inside / "a.yaml", 100) == b"title: a\n"
    for path in (outside / "a.yaml", inside / "link.yaml", inside / ".." / "else" / "a.yaml"):
        with pytest.raises(OSError, match="outside the allowed folders"):
            open_regular(path)
    for name, (suffix, opens) in OPENERS.items():
        (outside / f"b{suffix}").touch()
        with pytest.raises(BadInput, match="outside the allowed folders"):
            opens(str(outside / f"b{suffix}")), name


SECRET = "s3cr3t/hash+value"


@pytest.mark.parametrize(
    "text",
    [
        f"root:{SECRET}:\n",
        f"a: '{SECRET}\n",
        f"*{SECRET}",
        f"!{SECRET} x",
        f'"{SECRET}":\n',
        f"- @{SECRET}",
        f"{SECRET}",
    ],
)
def test_an_error_names_the_place_and_not_what_stands_there(tmp_path: Path, text: str):
    path = tmp_path / "x.yaml"
    path.write_text(text)
    dbc = tmp_path / "x.dbc"
    dbc.write_text(text)
    for opens in (lambda: open_any(f"live:{path}"), lambda: open_any(f"sim:{path}"), lambda: load_dbc(dbc)):
        with pytest.raises(BadInput) as told:
            opens()
        assert SECRET not in str(told.value)


def test_live_sensors_are_read_from_yaml_only():
    with pytest.raises(BadInput, match=r"not a text file that ends in \.yaml"):
        open_any("live:/etc/passwd")


def test_a_lack_of_descriptors_says_nothing_of_a_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_astyx(tmp_path / "drive")
    source = open_source(f"astyx:{tmp_path / 'drive'}")
    before = source.frame(1)
    with monkeypatch.context() as starved:

        def refuse(*_: object) -> int:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

        starved.setattr(user_files.os, "open", refuse)
        with pytest.raises(Overloaded, match="Too many open files"):
            source.frame(1)
    after = source.frame(1)
    assert (after.notes, after.sweep is None, after.image is None) == (before.notes, False, False)


@pytest.mark.timeout(20)
@pytest.mark.skipif(not hasattr(os, "O_PATH"), reason="needs Linux")
def test_a_pipe_that_is_refused_does_not_wake_its_writer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    os.mkfifo(tmp_path / "pipe")
    is_open, opened = [], os.open

    def opening(path: str | Path, flags: int, *rest: int) -> int:
        number = opened(path, flags, *rest)
        with suppress(OSError):  # refused as long as nobody reads it
            os.close(opened(tmp_path / "pipe", os.O_WRONLY | os.O_NONBLOCK))
            is_open.append(path)
        return number

    monkeypatch.setattr(os, "open", opening)
    with pytest.raises(OSError, match="not a regular file"):
        open_regular(tmp_path / "pipe")
    assert is_open == []


@pytest.mark.skipif(not hasattr(os, "O_PATH"), reason="needs Linux")
def test_a_name_that_changes_after_it_was_checked_leads_nowhere_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    allowed, secret, link = tmp_path / "allowed", tmp_path / "secret", tmp_path / "allowed" / "a"
    allowed.mkdir()
    secret.write_text("secret")
    (allowed / "mine").write_text("mine")
    link.symlink_to("mine")
    monkeypatch.setenv(FOLDERS_VARIABLE, str(allowed))
    check = user_files.check_allowed

    def changing(path: Path) -> None:
        check(path)
        link.unlink()
        link.symlink_to(secret)

    monkeypatch.setattr(user_files, "check_allowed", changing)
    with pytest.raises(OSError, match="outside the allowed folders"):
        open_regular(link)
