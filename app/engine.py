"""The one worker: it owns the source, the playback and the line, and shows a ``Snapshot`` after everything it does.

Callers say what they want through ``control``; the newest wish wins. Nothing is queued: late frames are skipped, and
a seek that is overtaken by another is dropped on the way.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

from app.control import Control, Wish
from app.drive.drives import Drives, DriveState
from app.drive.recording import Recipe
from app.line import DetectionCache, Line, Tick
from app.playback import PlaybackClock
from app.snapshot import Notice, Snapshot
from pipeline.params import Params
from pipeline.run import Detectors, Detects, Sensors, picture_size
from pipeline.sources.base import Source, SourceError, is_simulated
from pipeline.step import warm_up
from pipeline.types import RawBoxes
from pipeline.vision.runtime import DetectorError, DetectorMissing

logger = logging.getLogger("cipv.engine")

_PATIENCE_S = 10.0
"""A read that hangs must not keep the program from ending; the worker is a daemon."""

OpenSource = Callable[[str], Source]
OpenDetector = Callable[[Source], Detects[RawBoxes]]
Listener = Callable[[Snapshot], None]


class Engine:
    """``start`` it, send wishes through ``control``, read ``snapshot`` or listen. ``open_detector`` gives the
    one for a source's pictures; null runs without a camera's detector and says nothing about it. ``whole_drives``: a
    recording's whole drive is computed in the background (``drives``), so that any frame is shown as it is in it."""

    def __init__(
        self,
        open_source: OpenSource,
        open_detector: OpenDetector | None,
        params: Params,
        *,
        preset: str = "default",
        uri: str | None = None,
        sensors: Sensors = "both",
        playing: bool = False,
        whole_drives: bool = False,
    ) -> None:
        self.control = Control(Wish(params, preset, uri=uri, playing=playing))
        self.snapshot = Snapshot(params, preset)
        self._open_source = open_source
        self._open_detector = open_detector
        self._sensors: Sensors = sensors
        self._detections = DetectionCache()
        self.drives = Drives(open_source, self._detections) if whole_drives else None
        self._detectors: dict[tuple[bool, tuple[int, int] | None], Detects[RawBoxes]] = {}
        self._line: Line | None = None
        self._clock: PlaybackClock | None = None
        self._skipped = 0
        self._listeners: list[Listener] = []
        self._shown = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="cipv-engine", daemon=True)

    def start(self) -> None:
        if self.drives is not None:
            self.drives.on_change = self.control.change
            self.drives.start()
        self._thread.start()

    def stop(self) -> None:
        """End the worker. A network run or a read in progress is finished first."""
        self.control.change(stop=True)
        if self.drives is not None:
            self.drives.stop()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)

    @property
    def alive(self) -> bool:
        """False when the worker has ended."""
        return self._thread.is_alive()

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` on the worker's thread after every change; it must be quick. Returns how to end that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def wait_for(self, condition: Callable[[Snapshot], bool], timeout_s: float) -> Snapshot:
        """The first snapshot that satisfies ``condition``; TimeoutError when none came."""
        with self._shown:
            if not self._shown.wait_for(lambda: condition(self.snapshot), timeout_s):
                raise TimeoutError(f"nothing of the kind within {timeout_s:g} s; last: {self.snapshot.state_json()}")
            return self.snapshot

    # ------------------------------------------------------------ the worker

    def _work(self) -> None:
        warm_up()
        while True:
            wish = self.control.take(self._wait_s())
            if wish.stop:
                return
            try:
                with self._in_front():
                    self._serve(wish)
            except Exception as error:  # the worker outlives whatever a recording or a network does
                logger.exception("while serving %s", self.snapshot.uri)
                self._fail(f"{type(error).__name__}: {_first_line(error)}")

    def _serve(self, wish: Wish) -> None:
        if wish.uri is not None and not self._open(wish.uri):
            return None
        if self._line is None:
            return self._show(wish, None)
        shown = self.snapshot
        index, last = shown.index, len(self._line.source) - 1
        if wish.uri is not None or wish.target is not None:
            tick = self._seek(min(max(wish.target or 0, 0), last), wish)
        elif wish.steps < 0:
            tick = self._seek(max(0, index + wish.steps), wish)
        elif wish.steps > 0:
            tick = self._step(min(last, index + wish.steps), wish)
        elif wish.params is not shown.params:
            tick = self._line.rerun(wish.params)
        elif wish.playing and shown.playing:
            tick = self._play(wish)
        else:
            tick = self._line.rerun(wish.params) if self._line.can_be_exact() else None
        self._show(wish, tick)

    def _seek(self, index: int, wish: Wish) -> Tick | None:
        assert self._line is not None
        self._clock = None
        return self._line.seek(index, wish.params, self.control.superseded)

    def _step(self, index: int, wish: Wish) -> Tick | None:
        """Every frame up to ``index``, none skipped."""
        assert self._line is not None
        self._clock = None
        tick = None
        for i in range(self.snapshot.index + 1, index + 1):
            tick = self._line.advance(i, wish.params)
        return tick

    def _play(self, wish: Wish) -> Tick | None:
        """The frame that is due, if it is not the shown one. Frames that are late already are skipped."""
        assert self._line is not None
        if self._clock is None:
            return None
        index, now = self.snapshot.index, time.monotonic()
        if self._clock.wait_s(index, now) > 0:
            return None
        last = len(self._line.source) - 1
        if index < last:
            due = self._clock.due(now)
            self._skipped += due - index - 1
            return self._line.advance(due, wish.params)
        if wish.loop:
            return self._seek(0, wish)
        self.control.change(playing=False)
        return None

    def _wait_s(self) -> float | None:
        """Seconds until playback needs the worker; null while nothing is playing."""
        if self._clock is None or self._line is None:
            return None
        return self._clock.wait_s(self.snapshot.index, time.monotonic())

    # ------------------------------------------------------------ opening

    def _open(self, uri: str) -> bool:
        """Replace the recording; when it cannot be opened the old one stays, a notice says why, and this is false."""
        self._publish(replace(self.snapshot, busy=f"Opening {uri} …"))
        try:
            source = self._open_source(uri)
            if len(source) == 0:
                raise SourceError(f"{uri}: holds no frames")
        except SourceError as error:
            self._fail(str(error))
            return False
        notices = [Notice("info", text) for text in source.notes]
        detector = self._detector_for(source, notices) if self._sensors != "lidar" else None
        self._line = self._line_of(source, Detectors(detector))
        self._clock = None
        self._skipped = 0
        self._publish(
            replace(
                self.snapshot,
                uri=uri,
                title=source.title,
                rate_hz=source.rate_hz,
                count=len(source),
                duration_s=float(self._line.timeline_s[-1]),
                index=0,
                detector=detector.name if detector else None,
                notices=tuple(notices),
                tick=None,
                busy=None,
            )
        )
        return True

    def _line_of(self, source: Source, detectors: Detectors) -> Line:
        """The line for a recording, whose whole drive is computed beside it from now on."""
        if self.drives is None:
            return Line(source, detectors, self._detections, self._sensors)
        line = Line(source, detectors, self._detections, self._sensors, self.drives.state_before)
        self.drives.open(Recipe(source.uri, len(source), line.timeline_s, detectors, self._sensors))
        return line

    def _detector_for(self, source: Source, notices: list[Notice]) -> Detects[RawBoxes] | None:
        """The detector for the source's pictures; where there is none, LiDAR goes on alone and a notice says so."""
        if self._open_detector is None:
            return None
        kind = (is_simulated(source), picture_size(source))
        try:
            if kind not in self._detectors:
                self._detectors[kind] = self._open_detector(source)
        except (DetectorMissing, DetectorError) as error:
            rest = "LiDAR goes on alone." if self._sensors == "both" else "Without one the camera finds nothing."
            notices.append(Notice("warning", f"{error} {rest}"))
            return None
        detector = self._detectors[kind]
        notices += [Notice("warning", note) for note in detector.notes]
        return detector

    # ------------------------------------------------------------ showing

    def _fail(self, text: str) -> None:
        """Say what went wrong, and stop playing into it."""
        self._clock = None
        self.control.change(playing=False)
        notices = tuple(n for n in self.snapshot.notices if n.level != "error")
        self._publish(replace(self.snapshot, busy=None, playing=False, notices=(*notices, Notice("error", text))))

    def _show(self, wish: Wish, tick: Tick | None) -> None:
        """The next snapshot: the new tick if there is one, and the wishes as they stand."""
        shown, line = self.snapshot, self._line
        standing = self.control.peek()
        if line is None or not standing.playing:
            self._clock = None
        elif self._clock is None or self._clock.speed != standing.speed:
            index = tick.frame.index if tick else shown.index
            self._clock = PlaybackClock(
                line.timeline_s, time.monotonic(), float(line.timeline_s[index]), standing.speed
            )
        if self.drives is not None:
            self._tell_drives(self.drives, wish, tick)
        shown = replace(
            shown,
            drive=self.drives.state if self.drives is not None else DriveState(),
            can_undo=self.control.can_undo,
            can_redo=self.control.can_redo,
            params=wish.params,
            preset=wish.preset,
            params_revision=wish.params_revision,
            playing=standing.playing,
            speed=standing.speed,
            loop=standing.loop,
        )
        if tick is not None and line is not None:
            shown = replace(
                shown,
                tick=tick,
                index=tick.frame.index,
                time_s=float(line.timeline_s[tick.frame.index]),
                sequence=shown.sequence + 1,
                skipped=self._skipped,
                made_unix_s=time.time(),
                notices=tuple(n for n in shown.notices if n.level != "error"),
            )
        self._publish(shown)

    def _tell_drives(self, drives: Drives, wish: Wish, tick: Tick | None) -> None:
        drives.turn.playing(self._clock is not None)
        if tick is not None:
            drives.offer(tick.frame)
        if wish.settled:
            drives.want(wish.params, wish.preset)

    def _in_front(self) -> AbstractContextManager[None]:
        """What is done meanwhile goes before the computing of whole drives."""
        return self.drives.turn.foreground() if self.drives is not None else nullcontext()

    def _publish(self, snapshot: Snapshot) -> None:
        with self._shown:
            changed = snapshot != self.snapshot
            self.snapshot = snapshot
            self._shown.notify_all()
        if changed:
            for listener in tuple(self._listeners):
                self._tell(listener, snapshot)

    def _tell(self, listener: Listener, snapshot: Snapshot) -> None:
        try:
            listener(snapshot)
        except Exception:  # a view that fails takes neither the line nor the other views with it
            logger.exception("a view failed on frame %s", snapshot.index)


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or ["no reason given"])[0]
