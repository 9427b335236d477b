"""The state of the labels of the open recording, sent to every client."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.labels.tasks import TaskState


@dataclass(frozen=True)
class LabelState:
    """Published state of the labels of the open source."""

    revision: int = 0
    """Number of the newest act."""
    can_undo: bool = False
    """For anonymous parameter changes; a person's own undo is requested separately."""
    can_redo: bool = False
    """The same for redo."""
    labelled: bool = False
    """Whether it is a recording; otherwise only parameters are changed."""
    task: TaskState | None = None
    """Work in progress, or how the last one ended; None before the first."""
    trouble: str = ""
    """A problem with the database or with writing parameter changes; empty if there is none."""

    def to_json(self) -> dict[str, Any] | None:
        """None if the source cannot be labelled."""
        if not self.labelled:
            return None
        return {
            "revision": self.revision,
            "task": self.task.to_json() if self.task is not None else None,
        }
