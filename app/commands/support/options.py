"""Options that several commands share, and how they become parameters, a source and a detector. What opens one is
imported then: it takes a second, and help and parameters need none of it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import tyro

from pipeline.common.errors import BadInput
from pipeline.common.user_file_errors import parse_yaml
from pipeline.params import Params, ParamsError, from_yaml, preset, with_changes
from pipeline.source_kinds import usages

if TYPE_CHECKING:
    from pipeline.detection import Detectors
    from pipeline.run import Sensors
    from pipeline.types import Route
    from pipeline.types.source import AnySource, Source
    from pipeline.vision.detector import Detector

S = TypeVar("S", "Source", "AnySource")
SourceName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(help=f"What to open: {usages()}")]
RecordingName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(help=f"The recording: {usages(live=False)}")]


def planned(file: Path | None) -> Route | None:
    """The route of a file, if one is named."""
    if file is None:
        return None
    from pipeline.sources.route_files import load_route  # NMEA and map projections: only who names a route pays

    return load_route(str(file))


@dataclass(frozen=True)
class SourceOptions:
    """Where frames come from."""

    source: SourceName
    rings: int = 16
    """KITTI: LiDAR channels to keep, 16 as of a VLP-16 or 64 for all"""
    route: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The road to be driven, on which GNSS places the car: CSV (degrees, or metres of a UTM zone: r.csv?epsg=32632),
    GPX, an NMEA log or an earlier session"""

    def open(self) -> Source:
        """A recording. SourceError says in one sentence what is wrong, RouteError the same of the route."""
        from app.commands.support.open_with_progress import opened_recording
        from pipeline.sources.along_route import along_route

        return self._with_notes(along_route(opened_recording(self.source, self.rings), planned(self.route)))

    def open_any(self) -> AnySource:
        """A recording or sensors, whichever it names; sensors are not started yet. Errors as of ``open``."""
        from app.commands.support.open_with_progress import opened
        from pipeline.sources.along_route import along_route

        return self._with_notes(along_route(opened(self.source, self.rings), planned(self.route)))

    def _with_notes(self, source: S) -> S:
        """The source, after what there is to say about it."""
        for note in source.notes:
            print(f"cipv: {note}", file=sys.stderr)
        return source


@dataclass(frozen=True)
class LineOptions:
    """How frames are processed."""

    preset: Literal["default", "paper"] = "default"
    """Parameters to start from"""
    params: Path | None = None
    """A preset file (YAML), as the page saves it"""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Change one parameter, e.g. cluster.z_weight=0.4 (repeatable; `cipv params` lists them)"""
    detector: str | None = None
    """Name or path of an ONNX detector; else the registered default, then $CIPV_DATA/models, then the
    embedded one, trained on simulated cars only and is the default for sim:"""
    lanes: str | None = None
    """Name or path of an ONNX lane network, `classical` for the detector without one, or `off`; else the registered
    default, then $CIPV_DATA/models, then the classical one, which is the default for sim:. Live sensors on two
    cores want `classical`: TwinLiteNet makes every third result 180 ms old"""
    lanes_every: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Run the lane detector in every N-th frame only; between, its lines are predicted and age. Else in
    every third for a network, in more of them below 10 Hz, and in all for the classical one"""

    def parameters(self) -> Params:
        """preset, then --params, then each --set. ParamsError names the first that is wrong."""
        params = preset(self.preset)
        if self.params is not None:
            params = from_yaml(self.params, params)
        changes = {}
        for change in self.set:
            name, separator, value = change.partition("=")
            if not separator:
                raise ParamsError(f"--set {change}: expected NAME=VALUE")
            changes[name] = parse_yaml(value, f"--set {change}", ParamsError)
        return with_changes(params, changes)

    def changes_parameters(self) -> bool:
        """Whether a person asked for other parameters than the default ones."""
        return self.preset != "default" or self.params is not None or bool(self.set)

    def every(self) -> int | None:
        """Checked ``lanes_every``."""
        if self.lanes_every is not None and self.lanes_every < 1:
            raise BadInput(f"--lanes-every {self.lanes_every}: a number of frames, at least 1")
        return self.lanes_every

    def open_detectors(self, source: AnySource, sensors: Sensors = "both") -> Detectors:
        """Everything that looks at the source's pictures, with what there is to say about it. None for LiDAR alone, and
        where detections come with them."""
        from pipeline.detection import Detectors, brings_detections, lanes_for
        from pipeline.lanes.open_detector import usual_every

        every = self.every()
        if sensors == "lidar" or brings_detections(source):
            return Detectors()
        lanes = lanes_for(source, self.lanes)
        for note in lanes.notes if lanes is not None else ():
            print(f"cipv: {note}", file=sys.stderr)
        return Detectors(self.open_detector(source, sensors), lanes, every or usual_every(lanes, source.rate_hz))

    def open_detector(self, source: AnySource, sensors: Sensors = "both") -> Detector | None:
        """The detector for the source's pictures, with what there is to say about it. A named one that is missing is
        an error, and so is none for a camera on its own; else a sentence says so and LiDAR goes on alone."""
        from pipeline.detection import detector_for
        from pipeline.inference.runtime import DetectorMissing

        try:
            detector = detector_for(source, self.detector)
        except DetectorMissing as missing:
            if self.detector is not None or sensors == "camera":
                raise
            print(f"cipv: {missing}", file=sys.stderr)
            return None
        for note in detector.notes:
            print(f"cipv: {note}", file=sys.stderr)
        return detector
