"""Folders of PCD files, one a sweep."""

from __future__ import annotations

from pipeline.sources.pcd.source import PcdSource

__all__ = ["PcdSource"]
