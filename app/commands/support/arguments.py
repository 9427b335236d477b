"""Defines how options and arguments appear in a command's help."""

from __future__ import annotations

from typing import Any

import tyro


def option(metavar: str, **more: Any) -> Any:
    """An optional argument, whose help shows its metavar instead of ``None``."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="", **more)
