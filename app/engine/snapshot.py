"""An immutable snapshot of everything that a view may need to show the engine's current frame."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from app.drive.background_runs import DriveState
from app.engine.processed_frame import ProcessedFrame
from app.labels.service.state import LabelState
from pipeline.params import Params
from pipeline.types import StreamHealth
from pipeline.types.result_json import streams_json

if TYPE_CHECKING:
    from app.core.control import Wish
    from app.engine.player import Player
    from pipeline.detection import Detectors
    from pipeline.recording.recording_state import RecordingState


@dataclass(frozen=True)
class Notice:
    """A sentence shown in the dashboard, with the remedy if there is one."""

    level: Literal["info", "warning", "error"]
    """Defines the colour; only an ``error`` disappears by itself."""
    text: str
    """One or two sentences."""
    until_s: float = 0.0
    """An error disappears with the next frame, but not before this time of ``time.monotonic``."""

    @property
    def stays(self) -> bool:
        """Whether it is still shown with the next frame."""
        return self.level != "error" or time.monotonic() < self.until_s


@dataclass(frozen=True)
class Snapshot:
    """Source, playback and the shown frame at one moment."""

    params: Params
    """Parameters in use."""
    preset: str = "default"
    """The preset that the parameters started from."""
    params_revision: int = 0
    """Incremented with every change of parameters."""
    uri: str | None = None
    """As passed when the source was opened; None before."""
    title: str = ""
    """Title of the recording."""
    rate_hz: float = 0.0
    """Nominal frame rate; 0 when unknown."""
    count: int = 0
    """Frames of the recording; 0 for live sensors."""
    index: int = 0
    """Index of the shown frame."""
    time_s: float = 0.0
    """Position of the shown frame on the playback timeline, in seconds."""
    duration_s: float = 0.0
    """Duration of the whole timeline."""
    playing: bool = False
    """False pauses on the shown frame."""
    speed: float = 1.0
    """Playback rate; 1 is real time."""
    loop: bool = True
    """Whether playback starts again at the end of the drive."""
    busy: str | None = None
    """What the engine is doing while it cannot serve requests; None otherwise."""
    detector: str | None = None
    """Name of the network for vehicles; None without one."""
    lane_detector: str | None = None
    """Name of the lane detector; None without one."""
    notices: tuple[Notice, ...] = ()
    """Current notices for the user."""
    sequence: int = 0
    """Incremented with every new result."""
    skipped: int = 0
    """Frames since the source was opened that were not shown in time."""
    made_unix_s: float = 0.0
    """Wall-clock time when the result was ready, Unix seconds."""
    processed: ProcessedFrame | None = None
    """The shown frame; None before the first one."""
    drive: DriveState = DriveState()
    """Progress of the whole-drive run."""
    labels: LabelState = LabelState()
    """State of the labels of the open source."""
    live: bool = False
    """Whether the source is live sensors."""
    streams: tuple[StreamHealth, ...] = ()
    """Health of each live sensor, updated also while no tick arrives."""
    recording: RecordingState | None = None
    """None while nothing is recorded."""

    def opened(self, uri: str, player: Player, detectors: Detectors) -> Snapshot:
        """The next snapshot after another source was opened; keeps parameters and playback settings."""
        return replace(
            self,
            uri=uri,
            title=player.source.title,
            rate_hz=player.source.rate_hz,
            live=player.live,
            streams=(),
            count=player.count,
            duration_s=player.duration_s,
            index=0,
            time_s=0.0,
            detector=detectors.boxes.name if detectors.boxes else None,
            lane_detector=detectors.lanes.name if detectors.lanes else None,
            processed=None,
        )

    def following(self, wish: Wish, standing: Wish) -> Snapshot:
        """The next snapshot with the parameters that were served and the currently requested playback settings."""
        return replace(
            self,
            params=wish.params,
            preset=wish.preset,
            params_revision=wish.params_revision,
            playing=standing.playing,
            speed=standing.speed,
            loop=standing.loop,
        )

    def with_result(self, processed: ProcessedFrame, player: Player) -> Snapshot:
        """The next snapshot with a new result. Notices of the previous tick are removed."""
        return replace(
            self,
            processed=processed,
            index=processed.frame.index,
            time_s=player.time_s(processed),
            sequence=self.sequence + 1,
            skipped=player.skipped,
            made_unix_s=time.time(),
            notices=self.lasting_notices,
        )

    def failed(self, text: str, playing: bool) -> Snapshot:
        """The next snapshot after an error."""
        return replace(self, busy=None, playing=playing, notices=(*self.lasting_notices, Notice("error", text)))

    @property
    def lasting_notices(self) -> tuple[Notice, ...]:
        """Notices that remain after the tick they came with."""
        return tuple(notice for notice in self.notices if notice.stays)

    def state_json(self) -> dict[str, Any]:
        """The state without the result, in the format of the page and ``/api/state``."""
        return {
            "uri": self.uri,
            "title": self.title,
            "rate_hz": self.rate_hz,
            "count": self.count,
            "index": self.index,
            "frame": self.processed.frame.name if self.processed else None,
            "time_s": self.time_s,
            "duration_s": self.duration_s,
            "playing": self.playing,
            "speed": self.speed,
            "loop": self.loop,
            "busy": self.busy,
            "detector": self.detector,
            "lane_detector": self.lane_detector,
            "preset": self.preset,
            "params_revision": self.params_revision,
            "sequence": self.sequence,
            "skipped": self.skipped,
            "provisional": self.processed is not None and not self.processed.exact,
            "drive": self.drive.to_json(),
            "can_undo": self.labels.can_undo,
            "can_redo": self.labels.can_redo,
            "labels": self.labels.to_json(),
            "live": self.live,
            "streams": streams_json(self.streams),
            "recording": self.recording.to_json() if self.recording is not None else None,
            "notices": [{"level": n.level, "text": n.text} for n in (*self.notices, *self._of_parts())],
        }

    def _of_parts(self) -> list[Notice]:
        """What the labels and the recording report for as long as it holds."""
        found = [Notice("warning", self.labels.trouble)] if self.labels.trouble else []
        recording = self.recording
        if recording is not None and (text := recording.error or recording.trouble):
            found.append(Notice("error", text[0].upper() + text[1:]))
        return found
