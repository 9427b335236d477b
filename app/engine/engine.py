"""The engine's worker thread: it owns the open source, and publishes a ``Snapshot`` after each action.

Callers make requests through ``control``; the newest request wins. The player (``app/engine/player.py``) carries out
requests on a recording or on live sensors.
"""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from functools import partial
from typing import cast

from app.core.control import Control, Wish
from app.core.detection_cache import DetectionCache
from app.core.jobs import BackgroundJob, JobStatus
from app.core.stop_signals import SAVE_S
from app.drive.background_runs import BackgroundRuns
from app.drive.open_recording import RunSetup
from app.engine.detector_pool import ABLATION_NOTICES, DetectorPool, OpenDetector, OpenLanes
from app.engine.page_frames import PageFrames
from app.engine.player import OpenSource, Player
from app.engine.processed_frame import ProcessedFrame
from app.engine.recorded_player import RecordedPlayer
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Notice, Snapshot
from app.engine.snapshot_publisher import SnapshotPublisher
from app.engine.takeovers import Takeovers, stuck_notice, trouble_notice
from app.labels.service.desk import LabelDesk
from pipeline.common.errors import first_line
from pipeline.common.progress import Progress
from pipeline.common.watchdog import Stuck, Watchdog, at_work
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.types.source import AnySource, Source, SourceError, is_live_source
from pipeline.warm_up import is_warm, warm_up

logger = logging.getLogger("cipv.engine")

_PATIENCE_S = 2.0
"""How long the end waits for a network run or a read in progress."""
_TELL_EVERY_S = 0.25
"""How often pages are told how far the opening of a recording is."""
_COMPILING = "Preparing the pipeline … The first start after an installation takes about a minute."


class Engine:
    """``start`` it, send requests through ``control``, read ``snapshot`` or listen. ``open_detector`` returns the
    detector for a source's images; None runs without a vehicle detector and without a notice. ``open_lanes`` returns
    the lane detector, which runs on every ``lanes_every``-th frame. ``far_view_px``: side of the window of the second
    pass, None for none. ``whole_drives``: a recording's whole drive is computed in the background (``drives``), so that
    any frame is shown as in a complete run. ``recorder``: where what is shown can be recorded; by default the folder of
    this machine's sessions. ``labels``: the labels, and the steps that can be undone; by default discarded at the end.
    ``detections``: those of earlier frames; by default none are kept."""

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
        far_view_px: int | None = None,
        recorder: SessionRecorder | None = None,
        labels: LabelDesk | None = None,
        watchdog: Watchdog | None = None,
        detections: DetectionCache | None = None,
    ) -> None:
        self.control = Control(Wish(params, preset, uri=uri, playing=playing))
        self._publisher = SnapshotPublisher(Snapshot(params, preset))
        self.listen, self.wait_for = self._publisher.listen, self._publisher.wait_for
        self._open_source = open_source
        self._sensors: Sensors = sensors
        self._detections = detections or DetectionCache()
        self.drives = BackgroundRuns(self._detections)
        self.control.on_ask = self.drives.turn.asked
        self.page_frames = PageFrames(self.drives.turn.foreground)
        """For pages with their own playhead."""
        self.recorder = recorder or SessionRecorder()
        self.labels = labels or LabelDesk()
        self._whole_drives = whole_drives
        self._detectors = DetectorPool(open_detector, sensors, open_lanes, lanes_every, far_view_px)
        self._player: Player | None = None
        self.detectors = Detectors()
        """Detectors of the open source."""
        self.watchdog = self.drives.watchdog = self.recorder.watchdog = watchdog or Watchdog()
        self.takeovers = Takeovers(self.watchdog, self._work, self._say_stuck, self.control.change, self.drives.turn)

    def start(self) -> None:
        self.drives.on_change = self.recorder.on_change = self.control.change
        self.drives.on_stuck, self.drives.on_trouble = self._say_stuck, self._say_trouble
        self.drives.start()
        self.labels.start(self.control)
        self.takeovers.begin()

    def stop(self) -> None:
        """Close the recording, if any, end the worker, and close the databases. A network run or a read in progress is
        finished first, but waited for no longer than systems wait for a program that was asked to end."""
        self.control.change(stop=True)
        self.recorder.stop(SAVE_S)
        ends_s = time.monotonic() + _PATIENCE_S
        self.drives.stop(_PATIENCE_S)
        self.takeovers.end(max(0.0, ends_s - time.monotonic()))
        self._detections.close()
        self.labels.stop()

    @property
    def source(self) -> AnySource | None:
        """The open source."""
        player = self._player
        return player.source if player is not None else None

    @property
    def alive(self) -> bool:
        """False when the worker has ended."""
        return self.takeovers.thread.is_alive()

    @property
    def snapshot(self) -> Snapshot:
        """What is shown now. Use ``listen`` or ``wait_for`` for changes."""
        return self._publisher.snapshot

    # ------------------------------------------------------------ the worker

    def _work(self, is_first: bool) -> None:
        """is_first: false if it replaces a worker that hangs."""
        if not is_first:
            self._take_over()
        while True:
            if self.takeovers.asked():
                self._take_over()
            player = self._player
            wish = self.control.take(player.wait_s(self.snapshot.index) if player is not None else None)
            if wish.stop:
                return self._close()
            try:
                self._serve(wish)
            except Exception as error:  # the worker must survive any failure of a recording or a network
                logger.exception("while serving %s", self.snapshot.uri)
                self._fail(f"{type(error).__name__}: {first_line(error)}")

    def _serve(self, wish: Wish) -> None:
        """Serve a request with foreground priority, except while waiting for sensors, when background work may run."""
        turn = self.drives.turn
        if wish.uri is not None:
            with turn.foreground():
                if not self._open(wish.uri, wish):
                    return
                warm_up()  # usually already done by ``drives`` while the source was opened
                self._publisher.publish(replace(self.snapshot, busy=None))
        player = self._player
        if player is not None:
            player.wait(wish.params)
        with turn.foreground():
            processed = player.serve(wish, self.snapshot) if player is not None else None
            self._show(wish, processed)

    # ------------------------------------------------------------ workers that hang

    def _take_over(self) -> None:
        """Continue with the same source after the previous worker, or its helper, hung; with a new network if that
        hung."""
        player, gives_up = self._player, self.takeovers.gives_up
        if player is None:
            return
        if gives_up:
            self.detectors = Detectors()
        elif self.takeovers.of_network:
            self._detectors.forget()
            with at_work("opening networks"):
                self.detectors = self._detectors.both_for(player.source, [])
        self._player = player.successor(self.detectors) or self._player_of(player.source, self.detectors)
        if gives_up and not player.live:
            self.control.change(playing=False)
        elif not player.live:
            self.control.change(target=self.snapshot.index)

    def _say_stuck(self, stuck: Stuck, more: str = "") -> None:
        """A notice on every page and on the in-vehicle display, for a minute; permanently if a function is disabled
        from now on."""
        others = tuple(notice for notice in self.snapshot.notices if f"({stuck.doing})" not in notice.text)
        said = stuck_notice(stuck, more, is_recording=self.recorder.state is not None)
        self._publisher.publish(replace(self.snapshot, notices=(*others, said)))

    def _say_trouble(self, text: str) -> None:
        """The same for what needs no restart of this worker."""
        others = tuple(notice for notice in self.snapshot.notices if notice.text != text)
        self._publisher.publish(replace(self.snapshot, notices=(*others, trouble_notice(text))))

    # ------------------------------------------------------------ opening

    def _open(self, uri: str, wish: Wish) -> bool:
        """Replace the open source; if the new one cannot be opened, the old one stays, a notice gives the reason, and
        the result is false. If opening takes long, it is aborted for a newer request."""
        self._publisher.publish(replace(self.snapshot, busy=f"Opening {uri} …"))
        job = BackgroundJob(
            partial(self._opened, uri),
            lambda: self._tell_opening(uri, job.status),
            tell_every_s=_TELL_EVERY_S,
            is_superseded=self.control.superseded,
            name=f"opening {uri}",
        )
        job.run()
        source = job.result
        if job.status.state == "cancelled":
            self._publisher.publish(replace(self.snapshot, busy=None))
        if job.status.error is not None:
            self._fail(job.status.error)
        if source is None:
            return False
        notices = [Notice("info", text) for text in (*source.notes, *ABLATION_NOTICES[self._sensors])]
        detectors = self._detectors.both_for(source, notices)
        self.recorder.stop()
        self._close()
        self.takeovers.forget()
        player = self._player_of(source, detectors)
        player.open(wish)
        self._player, self.detectors = player, detectors
        self.labels.open(uri, self.drives.recording)
        opened = self._with_parts(self.snapshot.opened(uri, player, detectors))
        busy = None if is_warm() else _COMPILING
        self._publisher.publish(replace(opened, notices=tuple(notices), busy=busy))
        return True

    def _opened(self, uri: str, progress: Progress) -> AnySource:
        source = self._open_source(uri, progress=progress)
        if not is_live_source(source) and len(cast("Source", source)) == 0:
            raise SourceError(f"{uri}: contains no frames")
        return source

    def _tell_opening(self, uri: str, now: JobStatus) -> None:
        if not now.has_ended:
            self._publisher.publish(
                replace(self.snapshot, busy=f"Opening {uri} … {100 * now.done // max(1, now.total)} %")
            )

    def _player_of(self, source: AnySource, detectors: Detectors) -> Player:
        self.page_frames.open(None)
        if is_live_source(source):
            # decoding of sensor packets takes 0.1 s to import, so it is imported only for live sensors
            from app.engine.live_pipeline import LivePipeline
            from app.engine.live_player import LivePlayer

            of_lanes = partial(self.takeovers.watching_helper, "lane detection")
            live = LivePipeline(source, detectors, self._sensors, of_lanes)
            return LivePlayer(live, self.control, self.drives, self.recorder)
        recording = cast("Source", source)

        def seekable() -> SeekablePipeline:
            return SeekablePipeline(recording, detectors, self._detections, self._sensors, self.drives.state_before)

        pipeline = seekable()
        self.page_frames.open(seekable())
        setup = RunSetup(recording, pipeline.timeline_s, detectors, self._sensors) if self._whole_drives else None
        watching = partial(self.takeovers.watching_helper, "reading ahead")
        return RecordedPlayer(pipeline, self.control, self.drives, setup, self.recorder, watching)

    def _close(self) -> None:
        player, self._player = self._player, None
        if player is not None:
            player.close()

    # ------------------------------------------------------------ showing

    def _fail(self, text: str) -> None:
        """Show an error, and stop playback."""
        player = self._player
        playing = player is not None and player.goes_on_after_failing() and self.snapshot.playing
        if not playing:
            self.control.change(playing=False)
        self._publisher.publish(self.snapshot.failed(text, playing))

    def _show(self, wish: Wish, processed: ProcessedFrame | None) -> None:
        """The next snapshot: the new tick if there is one, and the current requests."""
        shown, player, standing = self.snapshot, self._player, self.control.peek()
        if player is not None:
            player.go_on(standing, processed.frame.index if processed is not None else shown.index)
        shown = self._with_parts(shown.following(wish, standing))
        if player is not None:
            shown = player.health(shown)
        if processed is not None and player is not None:
            shown = shown.with_result(processed, player)
        self._publisher.publish(shown)
        if processed is not None:
            self.labels.shown()

    def _with_parts(self, shown: Snapshot) -> Snapshot:
        """Adds the state of the drive's run, of recording and of the labels."""
        return replace(shown, drive=self.drives.state, recording=self.recorder.state, labels=self.labels.state)
