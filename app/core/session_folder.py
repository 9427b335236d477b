"""The folder in which this machine stores sessions, marks and the local label database."""

from __future__ import annotations

from pathlib import Path

SESSIONS = Path(__file__).resolve().parents[2] / "sessions"
