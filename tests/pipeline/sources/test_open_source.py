"""Opening every kind of recording, and the error if there is none."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from pipeline.sources import SourceError, open_any, open_source


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("nosuch:thing", "unknown kind of source 'nosuch'; use one of session.mcap, pcap:<file>, rosbag:<path>"),
        ("", "not a source; use one of session.mcap, pcap:<file>"),
        ("/somewhere/else", "/somewhere/else: not a source"),
        ("C:\\drives\\one", "not a source"),
        ("astyx:", "no folder given"),
        ("astyx:missing/folder", "missing/folder: no such folder"),
        ("kitti:missing/folder", "missing/folder: no such folder"),
        ("astyx:bad\0name", "no such folder"),
        ("astyx:~no_such_user_here/x", "~no_such_user_here/x: unknown home directory"),
        ("sim:", "no scenario named ''; there are"),
        ("sim:drive.xosc", "drive.xosc: cannot be read: No such file"),
        ("drive.xosc", "drive.xosc: cannot be read: No such file"),
        ("sim:drive.xosc?variant=x", "drive.xosc: variant='x': expected a number from 1"),
        ("sim:~no_such_user_here/x.xosc", "~no_such_user_here/x.xosc: unknown home directory"),
        ("s3://bucket/drive.xosc", "only sessions can be opened in a store"),
        ("sim:folder/nosuch", "folder/nosuch: not a scenario file: its name must end in .yaml or .xosc"),
        ("sim:nosuch", "no scenario named 'nosuch'; there are"),
        ("sim:nosuch.yaml", "nosuch.yaml: cannot be read"),
        ("sim:~no_such_user_here/x.yaml", "~no_such_user_here/x.yaml: unknown home directory"),
    ],
)
def test_a_wrong_uri_gives_one_sentence(uri: str, says: str) -> None:
    with pytest.raises(SourceError) as error:
        open_source(uri)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("uri", ["foo", "nosuch:thing"])
def test_live_sensors_are_named_where_they_are_taken_and_only_there(uri: str) -> None:
    with pytest.raises(SourceError, match=r"sim:<scenario, my.yaml or my.xosc>, live:<config.yaml>$"):
        open_any(uri)
    with pytest.raises(SourceError) as error:
        open_source(uri)
    assert "live" not in str(error.value)


@pytest.mark.parametrize("scheme", ["astyx", "kitti"])
def test_an_empty_folder_and_a_file_are_told_apart(scheme: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x")
    with pytest.raises(SourceError, match="is empty"):
        open_source(f"{scheme}:{tmp_path / 'empty'}")
    with pytest.raises(SourceError, match="not a folder"):
        open_source(f"{scheme}:{tmp_path / 'file'}")


@pytest.mark.parametrize("scheme", ["astyx", "kitti"])
def test_a_folder_of_something_else_is_refused(scheme: str, tmp_path: Path) -> None:
    (tmp_path / "holiday.txt").write_text("x")
    with pytest.raises(SourceError, match=r"not an? (Astyx|KITTI) recording"):
        open_source(f"{scheme}:{tmp_path}")


def test_a_bare_path_is_recognised_by_what_is_in_it(astyx: Path, kitti: Path) -> None:
    assert type(open_source(str(astyx))) is type(open_source(f"astyx:{astyx}"))
    assert type(open_source(str(kitti))) is type(open_source(f"kitti:{kitti}"))


def test_relative_paths_and_home_work(astyx: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(astyx.parent)
    monkeypatch.setenv("HOME", str(astyx.parent))
    assert len(open_source("astyx:astyx")) == len(open_source(f"astyx:~{os.sep}astyx")) == 2


def test_a_date_folder_points_to_its_drives(kitti_raw: Path) -> None:
    """A folder with a single drive stands for it."""
    assert len(open_source(f"kitti:{kitti_raw.parent}")) == len(open_source(f"kitti:{kitti_raw}"))
    shutil.copytree(kitti_raw, kitti_raw.parent / kitti_raw.name.replace("0009", "0010"))
    with pytest.raises(SourceError, match=r"it holds drives; open one of them, for example kitti:.*drive_0009_sync"):
        open_source(f"kitti:{kitti_raw.parent}")


@pytest.mark.parametrize("rings", [0, 15, 32])
def test_kitti_gives_16_or_64_rings(kitti: Path, rings: int) -> None:
    with pytest.raises(SourceError, match=f"{rings} rings requested"):
        open_source(f"kitti:{kitti}", rings=rings)
