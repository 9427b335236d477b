"""ROS 1 bags and ROS 2 bags (SQLite and MCAP), read without a ROS installation."""

from __future__ import annotations

from pipeline.sources.rosbag.source import RosbagSource

__all__ = ["RosbagSource"]
