"""What everybody is told of the labels of what is open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.labels.service.tasks import TaskState


@dataclass(frozen=True)
class LabelState:
    """revision: the number of the newest act. can_undo, can_redo: of changes of parameters that nobody put a name to;
    what a person can take back is for that person to ask. labelled: it is a recording; else only parameters are
    changed. trouble: what is wrong with the database, or went wrong with changes of parameters; empty for nothing."""

    revision: int = 0
    can_undo: bool = False
    can_redo: bool = False
    labelled: bool = False
    task: TaskState | None = None
    trouble: str = ""

    def to_json(self) -> dict[str, Any] | None:
        """None for what cannot be labelled."""
        if not self.labelled:
            return None
        return {
            "revision": self.revision,
            "task": self.task.to_json() if self.task is not None else None,
        }
