"""`cipv calibrate distance`: fit the paper's regression from box height to distance for another camera."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

import tyro
import yaml
from rich.console import Console
from rich.table import Table

from app.commands.support.options import PipelineOptions, SourceOptions
from pipeline.calibration.distance import LawFit, as_law, as_overrides, collect_pairs, fit_laws
from pipeline.common.errors import BadInput
from pipeline.detection import detector_for
from pipeline.inference.distance_laws import keep_law
from pipeline.inference.model_registry import EMBEDDED, find
from pipeline.types.source import Source


@dataclass(frozen=True)
class Calibrate:
    """Fit the distance law d = a·h^b for each class to the detections in a recording, for another car or camera.

    Example: cipv calibrate distance astyx:PATH --out law.yaml
    """

    what: tyro.conf.Positional[Literal["distance"]]
    """What to fit: distance from box height"""
    source: SourceOptions
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    truth: Literal["labels", "lidar"] = "labels"
    """Source of the true distances: labelled cuboids, or LiDAR boxes (needs no labels)"""
    free_exponent: bool = False
    """Fit b too, as in the paper. By default b = −1, which follows from a pinhole camera and generalises better"""
    out: Path | None = None
    """Write a preset file for `cipv run --params`"""
    keep: bool = False
    """Store the law with the detector; it is then used with that network unless a parameter overrides it"""
    json: bool = False
    """Print the laws and their figures as JSON"""

    def __call__(self) -> int:
        params = self.pipeline.parameters()
        source = self.source.open()
        detector = detector_for(source, self.pipeline.detector)
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
            self.out.write_text(yaml.safe_dump(as_overrides(fits), sort_keys=False), encoding="utf-8")
        if self.keep:
            kept = keep_law(detector.path, as_law(fits, params.distance.reference_focal_px), self._about(source, fits))
            print(f"{kept}: used with {detector.path.name} from now on", file=sys.stderr)
        return 0

    def _about(self, source: Source, fits: Mapping[str, LawFit]) -> dict[str, object]:
        """What a kept law was fitted to, and how well."""
        figures = {
            label: {"pairs": fit.pairs, "mean_relative_error": round(fit.mean_relative_error, 4)}
            for label, fit in fits.items()
        }
        return {"to": source.title, "truth": self.truth, "classes": figures}
