"""Errors in recorded messages."""

from __future__ import annotations


class Damaged(Exception):
    """A message that does not match its topic; the text is added to a frame's notes."""
