"""Options that several commands share, and their conversion to parameters, a source and detectors. Heavy modules are
imported on use: they take a second, and ``--help`` and ``cipv params`` do not need them."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import tyro

from app.commands.support.arguments import option
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.params import Params, ParamsError, from_yaml, preset, with_changes
from pipeline.source_kinds import usages

if TYPE_CHECKING:
    from pipeline.detection import DetectorChoice, Detectors
    from pipeline.run import Sensors
    from pipeline.types import Route
    from pipeline.types.source import AnySource, Source
    from pipeline.vision.detector import Detector

S = TypeVar("S", "Source", "AnySource")
SourceName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE", help=f"What to open: {usages()}")]
RecordingName = Annotated[
    str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE", help=f"The recording: {usages(live=False)}")
]


def planned(file: Path | None) -> Route | None:
    """The route in a file; None without a file."""
    if file is None:
        return None
    from pipeline.sources.route_files import load_route  # NMEA and map projections, imported only for routes

    return load_route(str(file))


@dataclass(frozen=True)
class SourceOptions:
    """The recording or live sensors to run on."""

    source: SourceName
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    route: Annotated[Path | None, option("FILE")] = None
    """Planned route, on which GNSS locates the car: CSV (degrees, or metres of a UTM zone: r.csv?epsg=32632),
    GPX, an NMEA log or an earlier session"""

    def open(self) -> Source:
        """Open a recording. SourceError or RouteError, in one sentence, if the source or route cannot be used."""
        from app.commands.support.open_with_progress import opened_recording
        from pipeline.sources.along_route import along_route

        return self._with_notes(along_route(opened_recording(self.source, self.rings), planned(self.route)))

    def open_any(self) -> AnySource:
        """Open a recording or live sensors; sensors are not started yet. Raises what ``open`` raises."""
        from app.commands.support.open_with_progress import opened
        from pipeline.sources.along_route import along_route

        return self._with_notes(along_route(opened(self.source, self.rings), planned(self.route)))

    def _with_notes(self, source: S) -> S:
        """Print the source's notes and return it."""
        for note in source.notes:
            print(f"cipv: {note}", file=sys.stderr)
        return source


@dataclass(frozen=True)
class PipelineOptions:
    """How the pipeline processes frames."""

    preset: Literal["default", "paper"] = "default"
    """Parameters to start from"""
    params: Annotated[Path | None, option("FILE")] = None
    """A preset file (YAML), e.g. one saved from the dashboard"""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Change one parameter, e.g. cluster.z_weight=0.4; `cipv params` lists them"""
    own_motion: Annotated[Literal["auto", "can", "gnss", "lidar", "off"] | None, option("auto|can|gnss|lidar|off")] = (
        None
    )
    """Where ego speed and yaw rate come from (motion.source). auto: what is recorded, and LiDAR odometry where that is
    missing; can: vehicle bus, odometry or IMU; gnss: GNSS receiver; lidar: LiDAR odometry alone; off: none"""
    detector: Annotated[str | None, option("NAME")] = None
    """Name or path of an ONNX detector. Default: the registered one, then $CIPV_DATA/models, then the embedded
    one, trained on simulated cars only, which is the default for sim:"""
    lanes: Annotated[str | None, option("NAME")] = None
    """Name or path of an ONNX lane network, `classical` for detection without a network, or `off`. Default: the
    registered one, then $CIPV_DATA/models, then `classical`, which is the default for sim:. Use `classical` for
    live sensors on two cores, where TwinLiteNet delays every third result by 180 ms"""
    lanes_every: Annotated[int | None, option("N")] = None
    """Run the lane detector on every N-th frame only and predict lanes in between. Default: every third frame
    for a network, more often below 10 Hz, and every frame for the classical detector"""
    far_view_px: Annotated[int, tyro.conf.arg(metavar="PX")] = 416
    """Run the detector a second time on the far part of the road, in a window this many native pixels wide; 0: never,
    and the lane network sees whole images only. Every other frame skips it when live sensors outpace the machine"""

    def parameters(self) -> Params:
        """The preset, changed by --params, then by each --set. ParamsError names the first invalid one."""
        params = preset(self.preset)
        if self.params is not None:
            params = from_yaml(self.params, params)
        changes: dict[str, object] = {}
        for change in self.set:
            name, separator, value = change.partition("=")
            if not separator:
                raise ParamsError(f"--set {change}: expected NAME=VALUE")
            changes[name] = parse_yaml(value, f"--set {change}", ParamsError)
        if self.own_motion is not None:
            changes["motion.source"] = self.own_motion
        return with_changes(params, changes)

    def changes_parameters(self) -> bool:
        """Whether the options select other parameters than the defaults."""
        return self.preset != "default" or self.params is not None or bool(self.set) or self.own_motion is not None

    def every(self) -> int | None:
        """``lanes_every``, validated."""
        if self.lanes_every is not None and self.lanes_every < 1:
            raise BadInput(f"--lanes-every {self.lanes_every}: expected at least 1")
        return self.lanes_every

    def far_px(self) -> int | None:
        """``far_view_px``, validated; None if it is off."""
        if self.far_view_px and not 64 <= self.far_view_px <= 2048:
            raise BadInput(f"--far-view-px {self.far_view_px}: expected 0, or 64 to 2048")
        return self.far_view_px or None

    def choice(self) -> DetectorChoice:
        """The selected networks."""
        from pipeline.detection import DetectorChoice

        return DetectorChoice(self.detector, self.lanes, self.every(), self.far_px())

    def open_detectors(self, source: AnySource, sensors: Sensors = "both") -> Detectors:
        """All detectors for the source's images; their notes are printed. Empty for LiDAR alone, and for recordings
        that contain detections."""
        from pipeline.detection import open_detectors

        return open_detectors(source, self.choice(), sensors, _say)

    def open_detector(self, source: AnySource, sensors: Sensors = "both") -> Detector | None:
        """The detector for the source's images; its notes are printed. DetectorMissing if the named one is missing or,
        with ``sensors="camera"``, if there is none; otherwise a message says so and LiDAR runs alone."""
        from pipeline.detection import open_boxes

        return open_boxes(source, self.detector, sensors, _say)


def _say(note: str) -> None:
    print(f"cipv: {note}", file=sys.stderr)
