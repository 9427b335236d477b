"""Defines how options and arguments appear in a command's help."""

from __future__ import annotations

from typing import Any

import tyro


def option(metavar: str, **more: Any) -> Any:
    """An option that may be left out: its help shows what it takes, and no ``None``."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="", **more)
