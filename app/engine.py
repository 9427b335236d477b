"""The one worker: it owns the source, the playback and the line, and shows a ``Snapshot`` after everything it does.

Callers say what they want through ``control``; the newest wish wins. Nothing is queued: late frames are skipped, and
a seek that is overtaken by another is dropped on the way.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from app.ahead import Ahead
from app.control import Control, Wish
from app.detector_pool import DetectorPool, OpenDetector, OpenLanes
from app.drive.drives import Drives
from app.drive.recording import Recipe
from app.line import DetectionCache, Line, Tick
from app.live_line import LiveLine, rerun
from app.playback import PlaybackClock
from app.recording import RecordingDesk
from app.showing import Showing
from app.snapshot import Notice, Snapshot
from pipeline.params import Params
from pipeline.run import Detectors, Sensors
from pipeline.sources.base import AnySource, LiveSource, Source, SourceError, is_live_source, is_simulated
from pipeline.step import warm_up
from pipeline.types import Frame

logger = logging.getLogger("cipv.engine")

_PATIENCE_S = 10.0
_READ_PATIENCE_S = 1.0
"""A read that hangs must not keep the program from ending; the worker is a daemon."""

_LIVE_WAIT_S = 0.02
"""How long a live line waits for a tick before it looks for new wishes."""
_HEALTH_EVERY_S = 0.5

OpenSource = Callable[[str], AnySource]


class Engine:
    """``start`` it, send wishes through ``control``, read ``snapshot`` or listen. ``open_detector`` gives the
    one for a source's pictures; null runs without a camera's detector and says nothing about it; ``open_lanes`` gives
    the lane detector, which looks at every ``lanes_every``-th frame. ``whole_drives``: a recording's whole drive is
    computed in the background (``drives``), so that any frame is shown as it is in it. ``desk``: where what is shown
    can be recorded; by default into the folder of this machine's sessions."""

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
        open_lanes: OpenLanes | None = None,
        lanes_every: int | None = None,
        desk: RecordingDesk | None = None,
    ) -> None:
        self.control = Control(Wish(params, preset, uri=uri, playing=playing))
        self._showing = Showing(Snapshot(params, preset))
        self.listen, self.wait_for = self._showing.listen, self._showing.wait_for
        self._open_source = open_source
        self._sensors: Sensors = sensors
        self._detections = DetectionCache()
        self.drives = Drives(_recordings_of(open_source), self._detections)
        self.desk = desk or RecordingDesk()
        self._whole_drives = whole_drives
        self._detectors = DetectorPool(open_detector, sensors, open_lanes, lanes_every)
        self._line: Line | None = None
        self._ahead: Ahead | None = None
        self._live: LiveLine | None = None
        self._health_told_s = 0.0
        self._clock: PlaybackClock | None = None
        self._skipped = 0
        self._thread = threading.Thread(target=self._work, name="cipv-engine", daemon=True)

    def start(self) -> None:
        self.drives.on_change = self.control.change
        self.drives.start()
        self._thread.start()

    def stop(self) -> None:
        """End the worker. A network run or a read in progress is finished first."""
        self.control.change(stop=True)
        self.drives.stop()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)
        if self._ahead is not None:
            self._ahead.end(_READ_PATIENCE_S)
        self.desk.stop()

    @property
    def source(self) -> AnySource | None:
        """What is open."""
        if self._live is not None:
            return self._live.source
        return self._line.source if self._line is not None else None

    @property
    def alive(self) -> bool:
        """False when the worker has ended."""
        return self._thread.is_alive()

    @property
    def snapshot(self) -> Snapshot:
        """What is shown now. ``listen`` and ``wait_for`` tell what is shown next."""
        return self._showing.snapshot

    # ------------------------------------------------------------ the worker

    def _work(self) -> None:
        warm_up()
        while True:
            wish = self.control.take(self._wait_s())
            if wish.stop:
                return self._close_live()
            try:
                self._serve(wish)
            except Exception as error:  # the worker outlives whatever a recording or a network does
                logger.exception("while serving %s", self.snapshot.uri)
                self._fail(f"{type(error).__name__}: {_first_line(error)}")

    def _serve(self, wish: Wish) -> None:
        """All in front, but for the wait for sensors: others may work then."""
        turn, came = self.drives.turn, None
        if wish.uri is not None:
            with turn.foreground():
                if not self._open(wish.uri):
                    return
        if self._live is not None:
            came = self._live.wait(wish.params, _LIVE_WAIT_S)
        with turn.foreground():
            if self._live is not None:
                self._serve_live(self._live, came, wish)
            else:
                self._serve_recording(wish)

    def _serve_recording(self, wish: Wish) -> None:
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
            tick = self._better(self._line, wish)
        self._show(wish, tick)

    def _seek(self, index: int, wish: Wish) -> Tick | None:
        assert self._line is not None
        self._clock = None
        return self._line.seek(index, wish.params, self.control.superseded, at_once=True)

    def _better(self, line: Line, wish: Wish) -> Tick | None:
        """The paused frame once more, when more is known of it than when it was shown: exactly as in the whole drive,
        or after a whole warm-up, which gives way to every wish."""
        if line.can_be_exact():
            return line.rerun(wish.params)
        shown = line.tick
        if shown is None or shown.warmed:
            return None
        try:
            return line.seek(shown.frame.index, wish.params, lambda: self.control.waiting)
        except BaseException:
            line.tick = replace(shown, warmed=True)  # what cannot be had is not tried again
            raise

    def _step(self, index: int, wish: Wish) -> Tick | None:
        """Every frame up to ``index``, none skipped."""
        assert self._line is not None
        self._clock = None
        tick = None
        for i in range(self.snapshot.index + 1, index + 1):
            tick = self._line.advance(i, wish.params)
        return tick

    def _play(self, wish: Wish) -> Tick | None:
        """The next frame that is due and was prepared, if there is one. Frames that are late already are skipped."""
        assert self._line is not None
        assert self._ahead is not None
        if self._clock is None:
            return None
        index, now = self.snapshot.index, time.monotonic()
        if self._clock.wait_s(index, now) > 0:
            return None
        last = len(self._line.source) - 1
        if index < last:
            due, ready = self._clock.due(now), self._ahead.ready
            if ready is None or not index < ready <= due:
                self._ahead.want(due)
                return None
            self._skipped += ready - index - 1
            return self._line.advance(ready, wish.params)
        if wish.loop:
            return self._seek(0, wish)
        self.control.change(playing=False)
        return None

    def _serve_live(self, live: LiveLine, came: Frame | None, wish: Wish) -> None:
        """The line goes on whether or not it is shown: paused, the shown tick is held and can be run again with other
        parameters; playing on jumps to now."""
        if came is not None:
            self.desk.take(live.run(came, wish.params))
        held, newest = self.snapshot.tick, live.tick
        is_behind = newest is not None and (held is None or newest.frame is not held.frame)
        if wish.playing and is_behind:
            tick = newest
        elif held is not None and wish.params is not self.snapshot.params:
            tick = rerun(held, wish.params)
        else:
            tick = None
        self._skipped = live.source.dropped
        self._show(wish, tick)

    def _wait_s(self) -> float | None:
        """Seconds until playback needs the worker; null while nothing is playing."""
        if self._live is not None:
            return 0.0  # it waits for its sensors instead
        if (
            self._clock is None
            and self._line is not None
            and self._line.tick is not None
            and not self._line.tick.warmed
        ):
            return 0.0
        if self._clock is None or self._line is None or self._ahead is None:
            return None
        if self._ahead.busy and self._clock.wait_s(self.snapshot.index, time.monotonic()) <= 0:
            return None  # what is due wakes the worker when it is there
        return self._clock.wait_s(self.snapshot.index, time.monotonic())

    # ------------------------------------------------------------ opening

    def _open(self, uri: str) -> bool:
        """Replace the recording; when it cannot be opened the old one stays, a notice says why, and this is false."""
        self._showing.publish(replace(self.snapshot, busy=f"Opening {uri} …"))
        try:
            source = self._open_source(uri)
            if not is_live_source(source) and len(cast("Source", source)) == 0:
                raise SourceError(f"{uri}: holds no frames")
        except SourceError as error:
            self._fail(str(error))
            return False
        notices = [Notice("info", text) for text in source.notes]
        detectors = self._detectors.both_for(source, notices)
        self.desk.stop()
        self._close_live()
        if is_live_source(source):
            self._open_live(source, detectors)
        else:
            self._line = self._line_of(cast("Source", source), detectors)
        self._clock = None
        self._skipped = 0
        self._showing.publish(
            replace(
                self.snapshot,
                uri=uri,
                title=source.title,
                rate_hz=source.rate_hz,
                live=self._live is not None,
                streams=(),
                count=len(self._line.source) if self._line is not None else 0,
                duration_s=float(self._line.timeline_s[-1]) if self._line is not None else 0.0,
                index=0,
                detector=detectors.boxes.name if detectors.boxes else None,
                lane_detector=detectors.lanes.name if detectors.lanes else None,
                notices=tuple(notices),
                tick=None,
                busy=None,
            )
        )
        return True

    def _open_live(self, source: LiveSource, detectors: Detectors) -> None:
        """Sensors instead of a recording, shown from the first tick on."""
        self._line = None
        self._end_ahead()
        self.drives.open(None)
        self._live = LiveLine(source, detectors, self._sensors)
        self._live.open()
        self.control.change(playing=True)

    def _close_live(self) -> None:
        if self._live is not None:
            self._live.close()
            self._live = None

    def _line_of(self, source: Source, detectors: Detectors) -> Line:
        """The line for a recording, whose whole drive is computed beside it from now on."""
        line = Line(source, detectors, self._detections, self._sensors, self.drives.state_before)
        self._end_ahead()
        self._ahead = Ahead(lambda index: self._prepare(line, index), self.control.change)
        recipe = Recipe(source.uri, len(source), line.timeline_s, detectors, self._sensors, is_simulated(source))
        self.drives.open(recipe if self._whole_drives else None)
        return line

    def _end_ahead(self) -> None:
        """What reads ahead holds the line that it reads for."""
        if self._ahead is not None:
            self._ahead.end()
            self._ahead = None

    def _prepare(self, line: Line, index: int) -> None:
        """On the thread that works ahead."""
        with self.drives.turn.foreground():
            line.prepare(index)

    # ------------------------------------------------------------ showing

    def _fail(self, text: str) -> None:
        """Say what went wrong, and stop playing into it; live sensors go on, and their next tick may do."""
        self._clock = None
        playing = self._live is not None and self.snapshot.playing
        if not playing:
            self.control.change(playing=False)
        notices = tuple(n for n in self.snapshot.notices if n.level != "error")
        self._showing.publish(
            replace(self.snapshot, busy=None, playing=playing, notices=(*notices, Notice("error", text)))
        )

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
        self._tell_drives(wish, tick)
        if tick is not None and line is not None:
            self.desk.take(tick)
        shown = replace(
            shown,
            drive=self.drives.state,
            recording=self.desk.state,
            can_undo=self.control.can_undo,
            can_redo=self.control.can_redo,
            params=wish.params,
            preset=wish.preset,
            params_revision=wish.params_revision,
            playing=standing.playing,
            speed=standing.speed,
            loop=standing.loop,
        )
        if self._live is not None and time.monotonic() - self._health_told_s > _HEALTH_EVERY_S:
            self._health_told_s = time.monotonic()
            shown = replace(shown, streams=self._live.source.health(), notices=self._live.with_silence(shown.notices))
        if tick is not None:
            shown = replace(
                shown,
                tick=tick,
                index=tick.frame.index,
                time_s=self._time_s(tick),
                sequence=shown.sequence + 1,
                skipped=self._skipped,
                made_unix_s=time.time(),
                notices=tuple(n for n in shown.notices if n.level != "error"),
            )
        self._showing.publish(shown)
        if self._clock is not None and self._ahead is not None and line is not None:
            last = len(line.source) - 1
            self._ahead.want(min(max(shown.index + 1, self._clock.due(time.monotonic())), last))

    def _time_s(self, tick: Tick) -> float:
        """Where the tick is on the timeline."""
        if self._live is not None:
            return self._live.time_s(tick)
        return float(self._line.timeline_s[tick.frame.index]) if self._line is not None else 0.0

    def _tell_drives(self, wish: Wish, tick: Tick | None) -> None:
        self.drives.turn.playing(self._clock is not None)
        if tick is not None:
            self.drives.offer(tick.frame)
        if wish.settled:
            self.drives.want(wish.params, wish.preset)


def _recordings_of(open_source: OpenSource) -> Callable[[str], Source]:
    """Opens again what was opened as a recording before."""
    return lambda uri: cast("Source", open_source(uri))


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or ["no reason given"])[0]
