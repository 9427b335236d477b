"""The class list of the project on this machine."""

from __future__ import annotations

import os
from pathlib import Path

from app.core.session_folder import SESSIONS
from pipeline.labels.classes import ClassList, default_classes, read_classes

VARIABLE = "CIPV_LABEL_CLASSES"
FILE = SESSIONS / "labels.yaml"


def project_classes() -> ClassList:
    """From the file in ``CIPV_LABEL_CLASSES``, else from ``sessions/labels.yaml``, else the defaults. BadInput in one
    sentence for a file that cannot be read."""
    named = os.environ.get(VARIABLE)
    if named:
        return read_classes(Path(named))
    return read_classes(FILE) if FILE.exists() else default_classes()
