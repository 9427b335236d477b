"""The real drives on which accuracy is measured; each is run once for all tests that need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from pipeline.calibration.distance import Pair, collect_pairs, fit_laws
from pipeline.detection import Detectors
from pipeline.evaluation.lead_verdict import Judged, LeadRule, judge
from pipeline.lanes.open_detector import usual_every
from pipeline.params import preset, with_changes
from pipeline.run import Sensors, through
from pipeline.sources import open_source
from pipeline.types import Frame, Result
from pipeline.types.source import Source
from tests import looking
from tests.looking import yolox_nano

FOLDERS = {
    "astyx": "astyx",
    "kitti": "kitti_0052",
    "street": "kitti_0009/2011_09_26/2011_09_26_drive_0009_sync",
}
"""Folder of each recording inside the data folder."""
SCHEMES = {"astyx": "astyx", "kitti": "kitti", "street": "kitti"}
"""Scheme with which each recording is opened."""
SCORED_CLIPS = {
    "lead near 20 m": range(60, 69),
    "following at 22–24 m": range(183, 193),
    "closing from 32 to 23 m": range(414, 426),
}
"""Astyx frames whose lead is scored. 057–059 are left out: during a lane change, the lead is half outside the
corridor."""
RECORDED_CLIPS = (range(47, 52), range(57, 69), range(183, 193), range(414, 426))
"""The continuous clips among the Astyx frames."""
EMPTY_CLIP = range(47, 52)
"""Astyx frames with nothing in path nearer than 70 m."""
_FAR_M = 60.0
RULE = LeadRule()


@dataclass(frozen=True)
class Drive:
    """The results of a recording and, if it is labelled, its verdicts, both by frame name."""

    results: dict[str, Result]
    judged: dict[str, Judged]

    def clip(self, numbers: range) -> list[Judged]:
        """The verdicts of Astyx frames, given by number."""
        return [self.judged[f"{number:06d}"] for number in numbers]


@cache
def drive(
    folder: Path,
    kind: str,
    preset_name: str = "default",
    sensors: Sensors = "both",
    changes: tuple[tuple[str, object], ...] = (),
    lanes: str = "twinlitenet",
    lanes_every: int | None = None,
    own_motion: bool = True,
) -> Drive:
    """Run a recording of the data folder with YOLOX-nano and TwinLiteNet. changes: dotted parameters on top of the
    preset. lanes: another lane detector, as on the command line, run on every ``lanes_every``-th image (None: the
    default). own_motion: False removes the recorded ego motion."""
    uri = f"{SCHEMES[kind]}:{folder / FOLDERS[kind]}"
    source, frames = opened(uri), frames_of(uri)
    if not own_motion:
        frames = tuple(replace(frame, ego=None, gnss=None) for frame in frames)
    params = with_changes(preset(preset_name), dict(changes))
    image = frames[0].image
    assert image is not None
    detector = yolox_nano(folder, image.bgr.shape[1], image.bgr.shape[0])
    results, judged = {}, {}
    found = looking.lanes(uri, lanes)
    every = lanes_every or usual_every(found and found.detector, source.rate_hz)
    far = looking.far_view(folder, image.bgr.shape[1], image.bgr.shape[0])
    detectors = Detectors(detector, found, every, far, far_lanes=looking.far_lanes(uri, lanes))
    for frame, result in through(frames, params, detectors, sensors):
        results[frame.name] = result
        truth = source.truth(frame.index)
        if truth is not None:
            judged[frame.name] = judge(result, truth, RULE)
    return Drive(results, judged)


@cache
def opened(uri: str) -> Source:
    """Opened once: that reads the whole folder."""
    return open_source(uri)


@cache
def frames_of(uri: str) -> tuple[Frame, ...]:
    """Read once: reading an image takes longer than running the pipeline on it."""
    source = opened(uri)
    return tuple(source.frame(index) for index in range(len(source)))


def all_scored(of: Drive) -> Iterator[Judged]:
    """The 31 frames of the three clips."""
    for numbers in SCORED_CLIPS.values():
        yield from of.clip(numbers)


def made_up_leads(of: Drive) -> int:
    """Number of frames with a near lead, out of the five of the empty clip."""
    leads = [of.results[f"{number:06d}"].cipv for number in EMPTY_CLIP]
    return sum(lead is not None and lead.distance_m <= _FAR_M for lead in leads)


def camera_alone_without_own_clip(folder: Path) -> Iterator[Judged]:
    """The 31 frames with the camera alone. The distance law for each clip is fitted to the other clips only."""
    for numbers in SCORED_CLIPS.values():
        own = next(recorded for recorded in RECORDED_CLIPS if numbers[0] in recorded)
        law = fit_laws([pair for pair in _pairs(folder) if int(pair.frame) not in own], exponent=-1.0)["car"].law
        changes = (("distance.coefficient", law.coefficient), ("distance.exponent", law.exponent))
        yield from drive(folder, "astyx", sensors="camera", changes=changes).clip(numbers)


@cache
def _pairs(folder: Path) -> tuple[Pair, ...]:
    """Every detected vehicle of Astyx with its labelled depth."""
    return collect_pairs(opened(f"astyx:{folder / FOLDERS['astyx']}"), yolox_nano(folder, 2048, 618))
