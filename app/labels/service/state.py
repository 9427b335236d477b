"""The state of the labels of the open recording, sent to every client."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.labels.service.tasks import TaskState


@dataclass(frozen=True)
class LabelState:
    """What everybody is told of the labels of what is open."""

    revision: int = 0
    """Number of the newest act."""
    can_undo: bool = False
    """Of changes of parameters that nobody put a name to; what a person can take back is for that person to ask."""
    can_redo: bool = False
    """The same, for what was taken back."""
    labelled: bool = False
    """Whether it is a recording; else only parameters are changed."""
    task: TaskState | None = None
    """Work in progress, or how the last one ended; None before the first."""
    trouble: str = ""
    """What is wrong with the database, or went wrong with changes of parameters; empty for nothing."""

    def to_json(self) -> dict[str, Any] | None:
        """None for what cannot be labelled."""
        if not self.labelled:
            return None
        return {
            "revision": self.revision,
            "task": self.task.to_json() if self.task is not None else None,
        }
