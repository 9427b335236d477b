"""The lane detectors on the real drives: in how many frames each finds the lines, whether the leads are right, and what
it costs.

    python -m tests.soak.lane_drives

Every image of KITTI 0009 and 0052 and of Astyx's continuous clips is looked at. A line counts if tracking has it with a
standard deviation below ``SURE_M`` 10 m ahead. KITTI 0009 shows a street without lane lines: what is found there is a
kerb, a seam or a shadow. *Apart*: the median distance, 10 m ahead, from the line of the detector that is named first.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pipeline.common.files.data_dir import data_dir
from pipeline.detection import Detectors, Detects, detect, lanes_for
from pipeline.params import Params
from pipeline.run import through
from pipeline.sources import Source, open_source
from pipeline.types import U8, RawLanes
from pipeline.types.lane import LaneLine
from tests.accuracy.drives import FOLDERS, RECORDED_CLIPS, SCHEMES

DETECTORS = ("twinlitenet", "twinlitenetplus_small", "lstr_360x640", "classical")
SURE_M, AT_M = 0.3, 10.0
_DRIVES = {"kitti": "KITTI 0052", "astyx": "Astyx", "street": "KITTI 0009, no lines"}


class Timed:
    """A lane detector that measures its processor time."""

    def __init__(self, detector: Detects[RawLanes]) -> None:
        self.name, self.notes = detector.name, detector.notes
        self.seconds: list[float] = []
        self._detector = detector

    def detect(self, bgr: U8) -> RawLanes:
        begun = time.process_time()
        found = self._detector.detect(bgr)
        self.seconds.append(time.process_time() - begun)
        return found


class Lines(NamedTuple):
    """Lateral position of the ego lane's lines 10 m ahead in one frame; NaN for one that is not known."""

    left_m: float
    right_m: float


def main() -> int:
    print("| drive | detector | both lines | one | none | apart | processor time |")
    print("|---|---|---|---|---|---|---|")
    for kind, title in _DRIVES.items():
        source, first = open_source(f"{SCHEMES[kind]}:{data_dir() / FOLDERS[kind]}"), None
        for name in DETECTORS:
            detector = lanes_for(source, name)
            assert detector is not None
            timed = Timed(detector)
            lines = np.array(list(_lines(source, _numbers(source, kind), timed)))
            first = first if first is not None else lines
            found = np.isfinite(lines).sum(axis=1)
            apart = np.abs(lines - first)[np.isfinite(lines - first)]
            counts = " | ".join(str(int((found == count).sum())) for count in (2, 1, 0))
            away = f"{np.median(apart):.2f} m" if len(apart) and name != DETECTORS[0] else "–"
            print(f"| {title} | `{name}` | {counts} | {away} | {1e3 * np.median(timed.seconds):.0f} ms |", flush=True)
    return 0


def _numbers(source: Source, kind: str) -> list[range]:
    """Indices of the frames that belong together."""
    if kind != "astyx":
        return [range(len(source))]
    names = [frame.name for frame in source.outlines()]
    clips = [[names.index(f"{number:06d}") for number in clip] for clip in RECORDED_CLIPS]
    return [range(clip[0], clip[-1] + 1) for clip in clips]


def _lines(source: Source, clips: list[range], detector: Timed) -> Iterator[Lines]:
    for clip in clips:
        seen = (detect(source.frame(index), Detectors(lanes=detector)) for index in clip)
        for _, result in through(seen, Params(), Detectors()):
            lane = result.layers.lanes if result.layers is not None else None
            sides = (lane.left, lane.right) if lane is not None else (None, None)
            yield Lines(*(_place(line) for line in sides))


def _place(line: LaneLine | None) -> float:
    return float(line.y_m(AT_M)) if line is not None and float(line.sigma_m(AT_M)) < SURE_M else float("nan")


if __name__ == "__main__":
    sys.exit(main())
