"""The labels of the open recording: acts on them, progress, and changes by others.

Database modules are imported when labels are first requested: SQLAlchemy takes most of a second to import, and the
first image does not wait for it.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.core.control import Control, Wish
from app.drive.open_recording import OpenRecording
from app.labels.acts.requests import Import, Lift, Propagate, Propose, Refit
from app.labels.service.opened import KeptLabels, Opened
from app.labels.service.param_write_queue import SettlingQueue
from app.labels.service.state import LabelState
from app.labels.tasks import Tasks
from pipeline.common.errors import BadInput
from pipeline.labels.classes import ClassList, default_classes
from pipeline.labels.formats.registry import FormatName
from pipeline.params import Params

if TYPE_CHECKING:
    from app.labels.service.checks import LabelChecks
    from app.labels.service.scoring import LabelScores
    from app.labels.store.act_log import Acted
    from app.labels.store.database import Database
    from app.labels.store.drive_labels import DriveLabels
    from app.labels.store.undo_order import Way
    from pipeline.sources.driven_way import DrivenWay

logger = logging.getLogger("cipv.labels")

_LOOK_EVERY_S = 0.4
"""Changes made through another server become visible within a second."""
_PATIENCE_S = 10.0


@dataclass(frozen=True)
class ActDone:
    """An act that is on disk, or changed nothing, and the labels it was applied to; these stay the same if another
    source is opened meanwhile."""

    acted: Acted
    """The change, with its number in the log."""
    labels: DriveLabels
    """Labels of the act's drive."""


class LabelDesk:
    """Any thread. database, open_later: see ``KeptLabels``; the database is also opened when the source is shown. The
    desk receives final parameter changes from ``Control``, sets parameters there on undo, and wakes it whenever
    ``state`` changes."""

    def __init__(
        self,
        database: Database | None = None,
        *,
        open_later: Callable[[], Database] | None = None,
        classes: ClassList | None = None,
    ) -> None:
        """classes: for recordings whose project has none; None for the defaults."""
        self.default_classes = classes or default_classes()
        self.kept = KeptLabels(database, open_later)
        self._control = Control(Wish(Params()))
        self._is_shown = False
        self._lock = threading.Lock()
        self._open = Opened("", None, self.kept)
        self._state = LabelState()
        self._wake = threading.Event()
        self._ended = False
        self._trouble = ""
        self._thread = threading.Thread(target=self._look, name="cipv-labels", daemon=True)
        self._beginning = threading.Lock()
        self._begun: tuple[str | None, int] = (None, 0)
        self._forgot: str | None = None
        self._settling = SettlingQueue(self.refresh)
        self.tasks = Tasks(self.refresh)

    # ------------------------------------------------------------ open source

    def start(self, control: Control) -> None:
        """control: source and target of parameter changes."""
        self._control = control
        control.on_settle = self.settle
        self._thread.start()

    def stop(self) -> None:
        """End the thread and the tasks, and close the database."""
        self._ended = True
        self._wake.set()
        self.tasks.stop()
        self._settling.stop()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)
        self.kept.close()

    def open(self, uri: str, recording: OpenRecording | None) -> None:
        """Another source was opened; None if it has no frames to label. Its labels are loaded later, when it is
        shown."""
        self.tasks.cancel()
        with self._lock:
            self._open = Opened(uri, recording, self.kept)
            self._state = LabelState(labelled=recording is not None)

    def shown(self) -> None:
        """The open source is shown: load its labels now."""
        self._is_shown = True

    @property
    def state(self) -> LabelState:
        return self._state

    @property
    def recording(self) -> OpenRecording:
        """The open recording. NoSuchLabel if there is none to label."""
        return self._open.framed()

    @cached_property
    def checks(self) -> LabelChecks:
        from app.labels.service.checks import LabelChecks  # the modules for the checks are not needed for driving

        return LabelChecks()

    @property
    def params(self) -> Params:
        """The current parameters."""
        return self._control.peek().params

    @property
    def labels(self) -> DriveLabels:
        """Labels of the open recording. NoSuchLabel if none is open."""
        opened = self._open
        opened.framed()
        return opened.labels

    @property
    def drive(self) -> str | None:
        """The key of the open recording; None if the source has no frames to label."""
        return self._open.key

    @property
    def classes(self) -> ClassList:
        """Of the open recording's project, else the default."""
        opened = self._open
        return (opened.labels.classes() if opened.recording is not None else None) or self.default_classes

    @cached_property
    def scores(self) -> LabelScores:
        """Scores of runs against labels."""
        from app.labels.service.scoring import LabelScores

        return LabelScores(self.default_classes, self._way_of)

    def _way_of(self, labels: DriveLabels) -> DrivenWay | None:
        opened = self._open
        return opened.recording.way if opened.recording is not None and opened.labels is labels else None

    # ------------------------------------------------------------ acts

    def act(self, person: str, act: Any, drive: str, act_id: str | None = None) -> ActDone:
        """Perform an act; it is on disk when this returns. Raises the error that refuses it. drive: key of the intended
        recording. act_id: chosen by the client; an act that was already sent is not repeated."""
        recording, labels = self._open.named(drive)
        done = labels.log.sent_before(act_id, person)
        if done is None:
            from app.labels.acts.registry import do
            from app.labels.acts.scope import Scope

            doing, note = act, ""
            if isinstance(act, Refit | Lift | Propagate):
                from app.labels.acts.measured import measured

                doing, note = measured(labels, recording, self._control.peek().params, act)
            scope = Scope(labels.info.t_ns, labels.classes() or self.default_classes)
            self._settling.finish()
            done = labels.log.act(doing.kind, person, lambda draft: do(draft, scope, doing), act_id=act_id, note=note)
            self.refresh()
        return ActDone(done, labels)

    def move(self, way: Way, person: str, drive: str | None, act_id: str | None = None) -> ActDone:
        """Undo or redo, across labels and parameters; parameters that are only being tried are reverted first.
        ActRefused if there is nothing to undo, or if it conflicts with another person's change. drive, act_id: see
        ``act``; None for a source without frames to label."""
        labels = self._open.meant(drive)
        self._settling.finish()
        with self._control.alone():  # a concurrent change would be overwritten by the restored values
            self._settling.finish()  # includes changes that arrived in the meantime
            acted = labels.log.sent_before(act_id, person)
            if acted is None and way == "undo" and self._forget_tried(act_id):
                from app.labels.store.act_log import Acted

                return ActDone(Acted(labels.revision, None, "the parameters being tried"), labels)
            if acted is None:
                acted = labels.log.move(way, person, self._control.check, act_id=act_id)
            if acted.params:
                self._control.restore(acted.params)
        self.refresh()
        return ActDone(acted, labels)

    def begin(self, person: str, act: Propose | Import, drive: str, act_id: str | None = None) -> int:
        """Start a long task; returns its id. ActRefused if another one is running, or if it is not possible. drive,
        act_id: see ``act``."""
        from app.labels.acts.bulk import importing_truth, proposing

        recording, labels = self._open.named(drive)
        with self._beginning:
            if act_id is not None and self._begun[0] == act_id:
                return self._begun[1]
            if isinstance(act, Propose):
                number = self.tasks.begin("propose", proposing(labels, recording, person, act.first, act.last))
            else:
                number = self.tasks.begin("import", importing_truth(labels, recording, person))
            self._begun = (act_id, number)
            return number

    def begin_import(self, person: str, file: Path, name: FormatName, drive: str) -> int:
        """Import labels from an uploaded file or folder of another tool; the file is removed at the end."""
        from app.labels.transfer.files import importing_file

        recording, labels = self._open.named(drive)
        return self.tasks.begin(
            "import", importing_file(labels, recording, person, file, name, labels.classes() or self.default_classes)
        )

    def possible(self, person: str) -> tuple[bool, bool]:
        """(can undo, can redo) for a person; both false while the database fails, so that changing parameters does not
        wait for a database that is known to be unavailable. Pending changes can be undone: the undo waits for them."""
        if self._settling.has(self._open.uri, person):
            return True, False
        if self._trouble:
            return False, False
        try:
            return self._open.labels.log.possible(person)
        except BadInput:
            return False, False

    def settle(self, changes: Mapping[str, tuple[Any, Any]], person: str = "", *, merges: bool = False) -> None:
        """Parameters were changed. A locked or failing database must not block driving: the change is written later, or
        a message says that it cannot be undone."""
        opened = self._open
        if not changes:
            return
        self._settling.put(opened.uri, lambda: opened.labels.log, changes, person, merges=merges)
        if self._settling.has(opened.uri, ""):
            self._show(opened, replace(self._state, can_undo=True, can_redo=False))

    def refresh(self) -> None:
        """Poll the database now. A recurring error is reported once, until the next success."""
        opened = self._open
        if not opened.uri:
            return
        try:
            labels = opened.labels
            on_its_way = self._settling.has(opened.uri, "")
            can_undo, can_redo = (True, False) if on_its_way else labels.log.possible("")
            revision = labels.revision
        except Exception as error:  # errors of a database or a recording must not stop driving
            if str(error) != self._trouble:
                logger.warning("labels: %s", error)
            self._trouble = str(error)
            self._show(opened, self._state)
            return
        self._trouble = ""
        self._show(opened, LabelState(revision, can_undo, can_redo, opened.recording is not None, self.tasks.state))

    # ------------------------------------------------------------ internal

    def _show(self, opened: Opened, new: LabelState) -> None:
        """Publish the state, unless another source is open by now."""
        with self._lock:
            if opened is not self._open:
                return
            new = replace(new, trouble=self._settling.trouble or self._trouble)
            changed, self._state = new != self._state, new
        if changed:
            self._control.change()

    def _forget_tried(self, act_id: str | None) -> bool:
        """Whether this reverted parameters that were being tried, now or in an earlier request with this id."""
        if act_id is not None and act_id == self._forgot:
            return True
        forgot = self._control.forget_tried()
        self._forgot = act_id if forgot else self._forgot
        return forgot

    def _look(self) -> None:
        """The polling thread: shows changes that others make in the same database."""
        while not self._ended:
            self._wake.wait(_LOOK_EVERY_S)
            self._wake.clear()
            is_time = self.kept.is_open or (self.kept.outlast and self._is_shown)
            if is_time and not self._ended:
                self.refresh()
