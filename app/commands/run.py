"""`cipv run`: run the pipeline on a recording and write results as JSON lines or a rerun recording."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Annotated, Literal, cast

from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress
from app.commands.support.sensor_wait import Waiting
from pipeline.common.files.whole_files import written_text
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import run, run_live
from pipeline.types import Frame, Result, most_sensors_first
from pipeline.types.result_json import write_line
from pipeline.types.source import AnySource, Source, is_live_source


@dataclass(frozen=True)
class RunPipeline:
    """Run the pipeline on a recording or on live sensors, and write one result per frame.

    Example: cipv run astyx:PATH --out results.jsonl --rrd drive.rrd
    """

    source: SourceOptions
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the car had this sensor only"""
    out: Annotated[Path | None, option("PATH")] = None
    """Write one JSON object per frame to this file; an existing file is replaced; - for standard output"""
    frames: Annotated[int | None, option("N")] = None
    """Stop after N frames; without it, live sensors run until Ctrl-C"""
    rrd: Annotated[Path | None, option("FILE")] = None
    """Write a rerun recording to this file; an existing file is replaced"""

    def __call__(self) -> int:
        params = self.pipeline.parameters()
        source = self.source.open_any()
        detectors = self.pipeline.open_detectors(source, self.sensors)
        tally = _Tally()
        with ExitStack() as stack:
            out = None
            if self.out is not None:
                to_stdout = str(self.out) == "-"
                out = sys.stdout if to_stdout else stack.enter_context(written_text(self.out))
            rerun_sink = None
            if self.rrd is not None:
                from app.views.rerun.view import RerunSink  # takes half a second to import

                rerun_sink = stack.enter_context(RerunSink(self.rrd, source.title, params.alignment))
            bar = stack.enter_context(frames_progress())
            total = self.frames if is_live_source(source) else len(cast("Source", source))
            task = bar.add_task(source.title, total=total)
            for frame, result in _until_interrupted(self._results(source, params, detectors), is_live_source(source)):
                if out is not None:
                    write_line(out, result)
                elif rerun_sink is None:
                    print(_sentence(result))
                if rerun_sink is not None:
                    rerun_sink.show(frame, result)
                tally.add(result)
                bar.advance(task)
        print(tally.sentence(), file=sys.stderr)
        return 0

    def _results(self, source: AnySource, params: Params, detectors: Detectors) -> Iterator[tuple[Frame, Result]]:
        """Frames with their results, at most ``frames``."""
        if is_live_source(source):
            every = run_live(source, params, detectors, self.sensors, Waiting(source))
        else:
            every = run(cast("Source", source), params, detectors, self.sensors)
        return islice(every, self.frames)


def _until_interrupted(results: Iterator[tuple[Frame, Result]], is_live: bool) -> Iterator[tuple[Frame, Result]]:
    """All results. Live sensors have no end, so Ctrl-C ends them without an error."""
    try:
        yield from results
    except KeyboardInterrupt:
        if not is_live:
            raise


def _sentence(result: Result) -> str:
    """A line of text about one frame."""
    lead = result.cipv
    if lead is None:
        return f"{result.frame}  no vehicle in path"
    source = next(item.source for item in result.objects if item.id == lead.id)
    closing = "" if lead.closing_speed_mps is None else f"  closing {lead.closing_speed_mps:+5.1f} m/s"
    ttc = "" if lead.ttc_s is None or lead.ttc_s > 60 else f"  TTC {lead.ttc_s:.1f} s"
    return f"{result.frame}  #{lead.id} {source:2} {lead.distance_m:6.2f} m{closing}{ttc}  {lead.reason}"


@dataclass
class _Tally:
    """Counts for the summary at the end."""

    frames: int = 0
    with_lead: int = 0
    degraded: int = 0
    step_ms: float = 0.0
    sources: Counter[str] = field(default_factory=Counter)

    def add(self, result: Result) -> None:
        self.frames += 1
        self.with_lead += result.cipv is not None
        self.degraded += bool(result.notes)
        self.step_ms += result.timing_ms["total"]
        self.sources.update(item.source for item in result.objects)

    def sentence(self) -> str:
        kinds = ", ".join(f"{self.sources[kind]} {kind}" for kind in most_sensors_first())
        hurt = f"; {self.degraded} degraded frames" if self.degraded else ""
        mean = self.step_ms / max(self.frames, 1)
        return f"cipv: {self.frames} frames, {self.with_lead} with a CIPV; {kinds}; {mean:.1f} ms per step{hurt}"
