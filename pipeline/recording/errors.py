"""Errors in recorded messages."""

from __future__ import annotations


class Damaged(Exception):
    """A message that is not what its topic says; the text is for a frame's notes."""
