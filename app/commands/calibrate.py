"""`cipv calibrate distance` fits the law from box height to distance for another camera, `cipv calibrate alignment` the
projection of LiDAR points into the image, `cipv calibrate mount` the mount of the LiDAR in the car, and `cipv calibrate
time` the time offsets of the sensors."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro
import yaml
from rich.console import Console
from rich.table import Table

from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress, task_progress
from app.commands.support.residual_images import write_residual_images
from pipeline.calibration.alignment.drive import fit_drive
from pipeline.calibration.alignment.fit import overlap_sentence
from pipeline.calibration.distance import LawFit, as_law, as_overrides, collect_pairs, fit_laws
from pipeline.calibration.mount.drive import fit_mount_drive
from pipeline.calibration.mount.fit import mount_sentence, turned
from pipeline.calibration.times import fit_times
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_new, write_new
from pipeline.detection import Detectors, detect, detector_for
from pipeline.formats.calibration_files.rig import write_rig
from pipeline.inference.distance_laws import keep_law
from pipeline.inference.model_registry import EMBEDDED, find
from pipeline.params import Params
from pipeline.types import Frame
from pipeline.types.source import Mounted, Source
from pipeline.vision.detector import Detector


@dataclass(frozen=True)
class Calibrate:
    """Fit to a recording, for another car or camera: the distance law d = a·h^b for each class, the alignment of LiDAR
    and camera from ordinary traffic, the mount of the LiDAR in the car from driving, or the time between the sensors.

    Example: cipv calibrate alignment kitti:PATH --model angular --out alignment.yaml
    """

    what: tyro.conf.Positional[Literal["distance", "alignment", "mount", "time"]]
    """distance: the distance law, from box heights; alignment: the rotation between LiDAR and camera; mount: yaw,
    pitch, roll and height of the LiDAR against the direction of travel and the road, and its offset from the axle;
    time: the time offset of the camera and the delay of ego speed"""
    source: SourceOptions
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    truth: Literal["labels", "lidar"] = "labels"
    """Source of the true distances: labelled cuboids, or LiDAR boxes (needs no labels)"""
    free_exponent: bool = False
    """Fit b too, as in the paper. By default b = −1, which follows from a pinhole camera and generalises better"""
    model: Literal["angular", "pinhole"] = "pinhole"
    """alignment: angular needs no calibration; pinhole corrects the mount of the recording's calibration"""
    offset: bool = False
    """alignment: also fit the pinhole camera's lateral and vertical position; the angles become less certain"""
    out: Annotated[Path | None, option("PATH")] = None
    """Write a preset file for `cipv run --params`; mount: a rig file. Must not exist"""
    images: Annotated[Path | None, option("FOLDER")] = None
    """alignment: write images of up to six frames with boxes, and clusters before and after the fit"""
    keep: bool = False
    """Store the law with the detector; it is then used with that network unless a parameter overrides it"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        self._check()
        params = self.pipeline.parameters()
        source = self.source.open()
        if self.what in ("mount", "time"):
            return (self._fit_mount if self.what == "mount" else self._fit_time)(params, source)
        detector = detector_for(source, self.pipeline.detector)
        return (self._fit_distance if self.what == "distance" else self._fit_alignment)(params, source, detector)

    def _check(self) -> None:
        """BadInput if an option belongs to another fit, or the file to write exists."""
        belongs = {
            "--model": (self.model != "pinhole", "alignment"),
            "--offset": (self.offset, "alignment"),
            "--images": (self.images is not None, "alignment"),
            "--truth": (self.truth != "labels", "distance"),
            "--free-exponent": (self.free_exponent, "distance"),
            "--keep": (self.keep, "distance"),
        }
        for name, (given, to) in belongs.items():
            if given and to != self.what:
                raise BadInput(f"{name} does not belong to `cipv calibrate {self.what}`")
        if self.out is not None:
            ensure_new(self.out)
        if self.offset and self.model == "angular":
            raise BadInput("--offset needs the pinhole model: the angular one has no position")

    def _fit_mount(self, params: Params, source: Source) -> int:
        mounted = source if isinstance(source, Mounted) else None
        if self.out is not None and mounted is None:
            raise BadInput("--out: this recording has its own mounts; a rig file is for pcap, pcd and rosbag")
        with frames_progress() as bar:
            fit = fit_mount_drive(source.frame, len(source), params, task_progress(bar, "driving"))
        if self.json:
            print(json.dumps(asdict(fit), indent=1))
        else:
            table = Table("LiDAR", "value", "± 1 σ", title=mount_sentence(fit))
            for name, value in fit.values.items():
                table.add_row(name, f"{value:.3f}", f"{fit.sigmas[name]:.2g}")
            Console().print(table)
        for warning in fit.warnings:
            print(f"cipv: {warning}", file=sys.stderr)
        if self.out is not None and mounted is not None:
            write_rig(self.out, *turned(fit, mounted.T_ego_lidar, source.frame(0).camera))
        return 0

    def _fit_alignment(self, params: Params, source: Source, detector: Detector) -> int:
        def frame_of(index: int) -> Frame:
            return detect(source.frame(index), Detectors(detector))

        with frames_progress() as bar:
            told = task_progress(bar, "fitting")
            fit = fit_drive(frame_of, len(source), self.model, params, self.offset, told)
        if self.json:
            print(json.dumps(asdict(fit), indent=1))
        else:
            table = Table("parameter", "value", "± 1 σ", title=f"{fit.pairs} vehicles in {fit.frames} frames")
            for name, value in fit.values.items():
                table.add_row(f"alignment.{name}", f"{value:g}", f"{fit.sigmas[name]:.2g}")
            Console().print(table)
            print(overlap_sentence(fit))
        for warning in fit.warnings:
            print(f"cipv: {warning}", file=sys.stderr)
        if self.out is not None:
            section = fit.section
            write_new(self.out, yaml.safe_dump({"alignment": section}, sort_keys=False))
        if self.images is not None:
            write_residual_images(self.images, frame_of, len(source), fit, params)
        return 0

    def _fit_time(self, params: Params, source: Source) -> int:
        with frames_progress() as bar:
            times = fit_times(source, params, task_progress(bar, "driving"))
        if self.json:
            found = {"camera": times.camera, "ego": times.ego}
            told = {name: asdict(each) if each is not None else None for name, each in found.items()}
            print(json.dumps({**told, "changes": times.changes}, indent=1))
        else:
            table = Table("parameter", "value", "± 1 σ", title=f"{times.images} images, {times.speeds} speeds")
            for name, value in times.changes.items():
                table.add_row(name, f"{value:+.1f} ms", f"{times.sigmas[name]:.1f}")
            Console().print(table)
        for warning in times.warnings:
            print(f"cipv: {warning}", file=sys.stderr)
        if self.out is not None:
            values = {name.removeprefix("sync."): value for name, value in times.changes.items()}
            write_new(self.out, yaml.safe_dump({"sync": values}, sort_keys=False))
        return 0

    def _fit_distance(self, params: Params, source: Source, detector: Detector) -> int:
        if self.keep and detector.path == find(EMBEDDED):
            raise BadInput(
                "the law of the embedded detector is built in; write a preset with --out and use it with --params"
            )
        if self.keep and not params.distance.scale_to_camera:
            raise BadInput(
                "--keep needs distance.scale_to_camera: a stored law must work with every camera; use --out instead"
            )
        pairs = collect_pairs(source, detector, self.truth, params)
        fits = fit_laws(pairs, None if self.free_exponent else -1.0)
        if self.json:
            print(json.dumps({label: asdict(fit) for label, fit in fits.items()}, indent=1))
        else:
            table = Table("class", "a", "b", "pairs", "mean error", "90th percentile", title="d = a · h^b")
            for label, fit in fits.items():
                numbers = (f"{fit.law.coefficient:.1f}", f"{fit.law.exponent:.3f}", str(fit.pairs))
                shares = (f"{100 * fit.mean_relative_error:.1f} %", f"{100 * fit.p90_relative_error:.1f} %")
                table.add_row(label, *numbers, *shares)
            Console().print(table)
        if self.out is not None:
            write_new(self.out, yaml.safe_dump(as_overrides(fits), sort_keys=False))
        if self.keep:
            kept = keep_law(detector.path, as_law(fits, params.distance.reference_focal_px), self._about(source, fits))
            print(f"{kept}: used with {detector.path.name} from now on", file=sys.stderr)
        return 0

    def _about(self, source: Source, fits: Mapping[str, LawFit]) -> dict[str, object]:
        """What a stored law was fitted to, and how well."""
        figures = {
            label: {"pairs": fit.pairs, "mean_relative_error": round(fit.mean_relative_error, 4)}
            for label, fit in fits.items()
        }
        return {"to": source.title, "truth": self.truth, "classes": figures}
