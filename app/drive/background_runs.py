"""Runs over whole drives in the background: the newest request first, and interactive requests take priority."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any, Literal

from app.core.detection_cache import DetectionCache
from app.drive.compute_scheduler import ComputeScheduler
from app.drive.full_run import DriveRun
from app.drive.look_ahead.worker import LookAhead
from app.drive.open_recording import OpenRecording, RunSetup
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from pipeline.common.watchdog import Stuck, Watchdog
from pipeline.inference.cancellation import Stopped
from pipeline.params import Params
from pipeline.step import State
from pipeline.types import Frame
from pipeline.warm_up import warm_up

logger = logging.getLogger("cipv.drive")

_TELL_EVERY_S = 0.25
"""How often pages are told how far a run is."""
_PATIENCE_S = 10.0
"""How long the end waits for a read in progress."""
_TRY_AGAIN_S = 0.5
"""Delay before a retry if the system could not read."""
_MOST_HANGS = 3
"""Number of hangs at one frame before its run is aborted."""
Phase = Literal["detect", "run", "done", "failed"]


@dataclass(frozen=True)
class DriveState:
    """Progress of the run with the current parameters over the whole drive."""

    revision: int = 0
    """Incremented whenever there is something new to fetch."""
    run: int | None = None
    """Number of the run; None without one."""
    base: int | None = None
    """Number of the base run for comparison."""
    done: int = 0
    """Number of processed frames."""
    total: int = 0
    """Number of frames in the drive."""
    running: bool = False
    """False if done, failed or cancelled."""
    phase: Phase = "done"
    """``detect`` while networks process the images for the first time, ``run`` afterwards."""
    note: str = ""
    """Why the run failed."""

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


class BackgroundRuns:
    """``open`` a recording, ``want`` other parameters, read ``recording``. ``on_change`` is called on any thread after
    a change of ``state``, at most every 0.25 s while a run is in progress."""

    def __init__(self, detections: DetectionCache) -> None:
        self.turn = ComputeScheduler()
        self.on_change: Callable[[], object] = lambda: None
        self.on_stuck: Callable[[Stuck], object] = lambda stuck: None
        self.on_trouble: Callable[[str], object] = lambda text: None
        """Called on any thread with a sentence about the process for networks."""
        self.watchdog = Watchdog()
        self._detections = detections
        self._condition = threading.Condition(threading.RLock())
        self._ahead = LookAhead(self.turn, self._wake, lambda text: self.on_trouble(text))
        self._recording: OpenRecording | None = None
        self._ended = False
        self._revision = 0
        self._told_s = 0.0
        self._phase: Phase = "run"
        self._hangs = 0
        self._thread = threading.Thread(target=self._work, name="cipv-drives", daemon=True)

    @property
    def recording(self) -> OpenRecording | None:
        """The open recording; None for live sensors, or if nothing is open."""
        return self._recording

    @property
    def state(self) -> DriveState:
        with self._condition:
            recording = self._recording
            if recording is None or recording.runs.current is None:
                return DriveState(self._revision)
            run, base = recording.runs.current, recording.runs.base
            phase: Phase = "failed" if run.note else "done" if run.is_complete else self._phase
            return DriveState(
                self._revision,
                run.number,
                base.number if base else None,
                run.done,
                run.total,
                not run.is_complete and not run.note,
                phase,
                run.note,
            )

    # ------------------------------------------------------------ requests

    def start(self) -> None:
        self._thread.start()

    def stop(self, patience_s: float = _PATIENCE_S) -> None:
        """End the thread. A running network is stopped; a read in progress is awaited for at most ``patience_s``."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()
            self._ahead.end()
        self.turn.end()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(patience_s)

    def open(self, setup: RunSetup, params: Params, preset: str) -> None:
        """Switch to another recording and its first run: none is seen that has no run."""
        with self._condition:
            self._ahead.end()
            recording = OpenRecording(
                setup, self._detections, self._recording.runs.next_number if self._recording else 1
            )
            recording.runs.want(params, preset)
            self._recording = recording
            self.changed()

    def close(self) -> None:
        """Leave the recording, for live sensors."""
        with self._condition:
            self._ahead.end()
            self._recording = None
            self.changed()

    def want(self, params: Params, preset: str) -> None:
        """Run the drive with these parameters unless that has been done. Other runs are postponed."""
        recording = self._recording
        if recording is not None and recording.runs.want(params, preset):
            self.changed()

    def offer(self, frame: Frame) -> None:
        """Reuse a frame that has just been read and processed by the detectors."""
        if self._recording is not None:
            self._recording.inputs.offer(frame)

    def state_before(self, index: int, params: Params) -> State | None:
        """The state of the whole-drive run before a frame; None if it has not got that far."""
        recording = self._recording
        return recording.state_before(index, params) if recording is not None else None

    def changed(self) -> None:
        """Announce that there is something new to fetch or to compute."""
        with self._condition:
            self._revision += 1
            self._told_s = time.monotonic()
            self._condition.notify_all()
        self.on_change()

    # ------------------------------------------------------------ the worker

    def _work(self) -> None:
        warm_up()
        with self.watchdog.watching("the drive's run", self._start_anew):
            self._run_all()

    def _start_anew(self, stuck: Stuck) -> None:
        """The worker hangs: another one continues with the same frame, and aborts the run after repeated hangs."""
        self.on_stuck(stuck)
        recording, self._hangs = self._recording, self._hangs + 1
        run = recording.runs.unfinished() if recording is not None else None
        if run is not None and self._hangs >= _MOST_HANGS:
            run.note, self._hangs = f"frame {run.done + 1}: {stuck.doing} hangs", 0
        with self._condition:
            if not self._ended:
                self._thread = threading.Thread(target=self._work, name="cipv-drives", daemon=True)
                self._thread.start()
        self.changed()

    def _run_all(self) -> None:
        while (work := self._next()) is not None:
            self._look_ahead(*work)
            with suppress(Stopped), self.turn.background():
                self._advance(*work)
            del work  # do not keep a closed recording in memory while idle

    def _next(self) -> tuple[OpenRecording, DriveRun] | None:
        """Wait for an unfinished run; None at the end."""
        with self._condition:
            while not self._ended:
                recording = self._recording
                run = recording.runs.unfinished() if recording is not None else None
                if recording is not None and run is not None:
                    return recording, run
                self._condition.wait()
            return None

    def _look_ahead(self, recording: OpenRecording, run: DriveRun) -> None:
        """Wait for the detections of a run's next frame as long as it is worth it, and this run is still the next."""
        is_seen = recording.has_been_looked_at(run.done)
        self._phase = "run" if is_seen else "detect"
        if is_seen:
            return
        with self._condition:
            if recording is self._recording and not self._ended:
                self._ahead.begin(recording, run.done, self.watchdog)
            while not self._ended and recording is self._recording and recording.runs.unfinished() is run:
                left_s = self._ahead.worth_waiting_s(recording, run.done)
                if left_s <= 0:
                    return
                self._condition.wait(left_s)

    def _wake(self) -> None:
        with self._condition:
            self._condition.notify_all()

    def _advance(self, recording: OpenRecording, run: DriveRun) -> None:
        """Process one frame. If this is stopped, the run is unchanged."""
        began = time.perf_counter()
        try:
            recording.advance(run, self._ahead.take(recording, run.done))
        except Stopped:
            raise
        except Overloaded as error:  # not a problem of the frame: it is read again, and until then nothing is final
            logger.warning("frame %s of %s: %s", run.done, recording.setup.uri, error)
            with self._condition:
                self._condition.wait_for(lambda: self._ended, _TRY_AGAIN_S)
        except BadInput as error:
            run.note = str(error)
        except Exception as error:  # if a recording or a network fails in any way, other runs continue
            logger.exception("frame %s of %s", run.done, recording.setup.uri)
            run.note = f"frame {run.done + 1}: {type(error).__name__}: {error}"
        finally:
            run.seconds += time.perf_counter() - began
        if run.is_complete or run.note or time.monotonic() - self._told_s > _TELL_EVERY_S:
            self.changed()
