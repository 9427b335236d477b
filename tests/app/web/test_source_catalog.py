"""What the page offers to open without a path being typed."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.web.source_catalog import catalog, recordings


def test_recordings_are_found_by_what_they_look_like(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_DATA", str(tmp_path))
    monkeypatch.setattr("app.web.source_catalog.SESSIONS", tmp_path / "none")
    nested = "raw/2011_09_26/2011_09_26_drive_0009_sync"
    for folder in ("drive/lidar_vlp16", "kitti_9/velodyne", "ros2", "clouds", "holiday", f"{nested}/velodyne_points"):
        (tmp_path / folder).mkdir(parents=True)
    for file in ("town.pcap", "town.mp4", "old.bag", "ros2/metadata.yaml", "clouds/1.pcd", "holiday/a.jpg"):
        (tmp_path / file).write_bytes(b"")
    assert recordings() == [
        (f"pcd:{tmp_path}/clouds", "pcd · clouds"),
        (f"astyx:{tmp_path}/drive", "astyx · drive"),
        (f"pictures:{tmp_path}/holiday", "pictures · holiday"),
        (f"kitti:{tmp_path}/kitti_9", "kitti_9"),
        (f"rosbag:{tmp_path}/old.bag", "rosbag · old.bag"),
        (f"rosbag:{tmp_path}/ros2", "rosbag · ros2"),
        (f"video:{tmp_path}/town.mp4", "video · town.mp4"),
        (f"pcap:{tmp_path}/town.pcap", "pcap · town.pcap"),
        (f"kitti:{tmp_path}/{nested}", "kitti · 2011_09_26_drive_0009_sync"),
    ]
    assert ("sim:straight", "Following on a straight motorway") in catalog()


def test_a_tree_of_other_files_is_not_searched_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_DATA", str(tmp_path))
    monkeypatch.setattr("app.web.source_catalog.SESSIONS", tmp_path / "none")
    for number in range(40):
        (tmp_path / f"notes{number:02d}" / "more").mkdir(parents=True)
        (tmp_path / f"notes{number:02d}" / "more" / "town.pcap").write_bytes(b"")
    asked: list[Path] = []
    monkeypatch.setattr("app.web.source_catalog.looks_like", lambda path: asked.append(path))
    monkeypatch.setattr("app.web.source_catalog._MOST_ENTRIES", 60)
    assert recordings() == []
    assert len(asked) == 60
