"""What the drift watch says on the real recordings, as they are and with their calibration turned.

    python -m tests.soak.real_drift [--drives kitti_0009,kitti_0052,astyx]

Each recording runs through the whole pipeline, with YOLOX-nano, its far view and TwinLiteNet, with its own calibration,
and with one that is turned from the first frame on, or from the middle one. The recordings last seconds. Prints what is
reported, and the last estimate of both angles with their standard deviations, whether they were reported or not.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from pipeline.alignment.projection import corrected
from pipeline.common.files.data_dir import data_dir
from pipeline.detection import Detectors, camera_of, detect, far_lanes_for, lanes_for
from pipeline.lanes.open_detector import usual_every
from pipeline.params import AlignmentParams, preset
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import Frame
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import open_far_view
from tests.soak.alignment_starts import RECORDINGS

TURNS = ((1.0, 0.0), (-1.0, 0.0), (2.0, 0.0), (-2.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.0, 2.0), (0.0, -2.0))
"""Of the camera, yaw and pitch in degrees."""


def frames_of(uri: str) -> list[Frame]:
    """With what the networks see."""
    kind, _, folder = uri.partition(":")
    source = open_source(f"{kind}:{data_dir() / folder}")
    frames = [source.frame(index) for index in range(len(source))]
    size = next((each.image.bgr.shape[1], each.image.bgr.shape[0]) for each in frames if each.image is not None)
    network, lanes = (
        open_detector(str(data_dir() / "models" / "yolox_nano.onnx"), size),
        lanes_for(source, "twinlitenet"),
    )
    every, far = usual_every(lanes, source.rate_hz), open_far_view(network, size)
    detectors = Detectors(network, lanes, every, far, far_lanes=far_lanes_for(camera_of(source), lanes))
    return [detect(each, detectors) for each in frames]


def turned(frame: Frame, yaw_deg: float, pitch_deg: float) -> Frame:
    """As if the camera had turned: its calibration is turned the other way."""
    assert frame.camera is not None
    params = AlignmentParams(yaw_deg=-yaw_deg, pitch_deg=-pitch_deg)
    return replace(frame, camera=corrected(params, frame.camera))


def watched(frames: Sequence[Frame]) -> str:
    """The reports and the last estimates, in words."""
    state, params, reports = State(), preset("default"), dict[str, str]()
    for frame in frames:
        state, result = step(state, frame, params)
        for note in result.notes:
            if "has turned" in note:
                reports.setdefault(note.partition(". Nothing")[0], frame.name)
    yaw, pitch = state.drift.found.estimates
    last = ", ".join(
        f"{name} {each.angle_deg:+.2f}° ± {each.sigma_deg:.2f}° ({each.vehicles} vehicles)"
        for name, each in (("yaw", yaw), ("pitch", pitch))
        if each is not None
    )
    told = "; ".join(f"{note} (frame {name})" for note, name in list(reports.items())[:1])
    return f"{told or 'nothing reported'} | {last or 'no estimate'}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", default=",".join(RECORDINGS))
    asked = parser.parse_args()
    print("| recording | camera turned | reported | last estimate |")
    for name in asked.drives.split(","):
        for uri in RECORDINGS[name]:
            frames = frames_of(uri)
            seconds = (frames[-1].t_ns - frames[0].t_ns) / 1e9
            title = f"{uri} ({len(frames)} frames, {seconds:.0f} s)"
            print(f"| {title} | not | {watched(frames)} |", flush=True)
            for yaw_deg, pitch_deg in TURNS:
                words = f"yaw {yaw_deg:+g}°" if yaw_deg else f"pitch {pitch_deg:+g}°"
                for first, when in ((0, "from the start"), (len(frames) // 2, f"in frame {len(frames) // 2}")):
                    changed = [turned(each, yaw_deg, pitch_deg) for each in frames[first:]]
                    print(f"| | {words} {when} | {watched([*frames[:first], *changed])} |", flush=True)


if __name__ == "__main__":
    main()
