"""Every parameter of the pipeline, declared once: default, bounds, step, unit and help.

The sliders of the page, ``--set`` and ``--params`` of the command line, the API's schema and the preset files all use
this declaration. Angles are in degrees here; the stages convert them to radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import did_you_mean, read_yaml
from pipeline.params.control import AccParams, AebParams
from pipeline.params.declare import Section
from pipeline.params.driving import (
    CipvParams,
    LaneParams,
    MotionParams,
    PathParams,
    SyncParams,
    TimeParams,
)
from pipeline.params.lidar import (
    BoxParams,
    ClusterParams,
    DeskewParams,
    DownsampleParams,
    GroundParams,
    LidarTrackingParams,
)
from pipeline.params.vision import (
    AlignmentParams,
    DetectionParams,
    DistanceParams,
    ExistenceParams,
    FusionParams,
    VisionTrackingParams,
)

__all__ = [
    "PRESETS",
    "AccParams",
    "AebParams",
    "AlignmentParams",
    "BoxParams",
    "CipvParams",
    "ClusterParams",
    "DeskewParams",
    "DetectionParams",
    "DistanceParams",
    "DownsampleParams",
    "ExistenceParams",
    "FusionParams",
    "GroundParams",
    "LaneParams",
    "LidarTrackingParams",
    "MotionParams",
    "Params",
    "ParamsError",
    "PathParams",
    "Section",
    "SyncParams",
    "TimeParams",
    "VisionTrackingParams",
    "from_yaml",
    "preset",
    "to_yaml",
    "with_changes",
]


class ParamsError(BadInput):
    """A parameter that does not exist or a value out of its bounds; the text names it."""


class Params(Section):
    """All parameters of the pipeline, by stage."""

    deskew: DeskewParams = DeskewParams()
    """LiDAR: correcting a sweep for ego motion."""
    downsample: DownsampleParams = DownsampleParams()
    """LiDAR: thinning out points, channel by channel."""
    ground: GroundParams = GroundParams()
    """LiDAR: separating the road from what stands on it."""
    cluster: ClusterParams = ClusterParams()
    """LiDAR: grouping points into clusters."""
    box: BoxParams = BoxParams()
    """LiDAR: the cuboid around a cluster."""
    lidar_tracking: LidarTrackingParams = LidarTrackingParams()
    """LiDAR: tracking clusters from sweep to sweep."""
    detection: DetectionParams = DetectionParams()
    """Camera: which of the detector's boxes are kept."""
    distance: DistanceParams = DistanceParams()
    """Camera: the distance of a box, from its height."""
    vision_tracking: VisionTrackingParams = VisionTrackingParams()
    """Camera: tracking boxes from image to image."""
    alignment: AlignmentParams = AlignmentParams()
    """How points are projected into the image."""
    fusion: FusionParams = FusionParams()
    """Which LiDAR track and which camera track are one object."""
    existence: ExistenceParams = ExistenceParams()
    """Evidence of each sensor for and against an object."""
    motion: MotionParams = MotionParams()
    """Where ego motion comes from, and what counts as moving."""
    lanes: LaneParams = LaneParams()
    """Detecting and tracking lane lines."""
    path: PathParams = PathParams()
    """The predicted path of the car."""
    cipv: CipvParams = CipvParams()
    """Who can be the lead, and who is."""
    acc: AccParams = AccParams()
    """Adaptive cruise control: following the lead."""
    aeb: AebParams = AebParams()
    """Warning and emergency braking."""
    time: TimeParams = TimeParams()
    """Where one clip of a recording ends and the next begins."""
    sync: SyncParams = SyncParams()
    """Live sensors: which messages make one tick."""


PRESETS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "default": {},
    "paper": {
        "motion": {"source": "can", "keep_over_ground": False},
        "cluster": {"divide_m": 3.0, "divide_tracked": False, "divide_nearer": False},
        "box": {"method": "axis_aligned"},
        "lidar_tracking": {"filter": "trajectory", "rigid_sideways": False, "cut_off_is_no_motion": False},
        "detection": {"far_view": False, "car_prior": 1.0},
        "distance": {
            "coefficient": 1829.1,
            "exponent": -1.093,
            "depth_along_axis": False,
            "per_class": False,
            "binning": True,
            "max_m": 60.0,
        },
        "vision_tracking": {"filter": "queue"},
        "alignment": {"model": "angular"},
        "fusion": {
            "assignment": "greedy",
            "min_iou": 0.0,
            "ring_gap_deg": 0.0,
            "range_gate": False,
            "size_gate": False,
            "keep_partners": False,
            "single_returns": False,
            "roof_share": 0.0,
            "settled_boxes": False,
            "merged_clusters": False,
            "use_ground_contact": False,
        },
        "existence": {"enabled": False, "forget_at_takeover": False},
        "path": {"use_edges": False, "use_corners": False},
        "cipv": {
            "use_crossing": False,
            "forget_at_takeover": False,
            "confirm_lead": False,
            "narrow_along": False,
            "prove_cut_in": False,
            "max_short_side_m": 40.0,
            "confirm_hits": 1,
            "carried_may_become_lead": True,
            "hysteresis_m": 0.0,
            "use_flank": False,
            "road_goes_on": 0.0,
            "decide_s": 0.0,
            "become_existence": 0.0,
            "become_probability": 0.0,
            "become_camera": 0.0,
            "become_standing": 0.0,
            "become_oncoming": 0.0,
            "stay_probability": 0.0,
            "stay_driving": 0.0,
            "stay_standing": 0.0,
        },
        "acc": {
            "comfort_decel_mps2": 8.0,
            "comfort_jerk_mps3": 0.0,
            "approach_decel_mps2": 0.0,
            "gap_sigmas": 0.0,
            "confirm_frames": 1,
            "speed_hits": 1,
        },
        "aeb": {
            "enabled": False,
            "closing_sigmas": 0.0,
            "react_to_present": False,
            "react_where_met": False,
            "react_to_crossing": False,
        },
    },
}
"""The values of each preset that differ from the declared defaults."""


def preset(name: str) -> Params:
    """The named preset. ParamsError for an unknown name."""
    if name not in PRESETS:
        raise ParamsError(f"no preset named {name!r}; there are {', '.join(PRESETS)}")
    return _validated(dict(PRESETS[name]))


def with_changes(params: Params, changes: Mapping[str, Any]) -> Params:
    """``params`` with dotted names replaced: ``{"cluster.z_weight": 0.4}``. ParamsError names what is wrong."""
    data: dict[str, dict[str, Any]] = params.model_dump()
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if section not in data or key not in data[section]:
            names = [f"{section}.{key}" for section, values in data.items() for key in values]
            raise ParamsError(f"no parameter named {name!r}{did_you_mean(name, names)}")
        data[section][key] = value
    return _validated(data)


def flat(params: Params) -> dict[str, Any]:
    """``{"cluster.z_weight": 0.4, …}`` in the order in which they are declared."""
    return {
        f"{section}.{key}": value for section, values in params.model_dump().items() for key, value in values.items()
    }


def changes_of(base: Params, params: Params) -> dict[str, tuple[Any, Any]]:
    """``{"cluster.z_weight": (0.4, 0.3)}``: what differs, before and after."""
    before, after = flat(base), flat(params)
    return {name: (before[name], value) for name, value in after.items() if value != before[name]}


def from_yaml(path: Path, base: Params) -> Params:
    """``base`` with a preset file's values: a mapping of section to parameter to value."""
    loaded = read_yaml(path, str(path), ParamsError) or {}
    if not isinstance(loaded, dict) or not all(isinstance(values, dict) for values in loaded.values()):
        raise ParamsError(f"{path}: expected sections with parameters below them")
    changes = {f"{section}.{key}": value for section, values in loaded.items() for key, value in values.items()}
    return with_changes(base, changes)


def to_yaml(params: Params) -> str:
    """A preset file that ``from_yaml`` and ``--params`` take back."""
    return yaml.safe_dump(params.model_dump(), sort_keys=False)


def _validated(data: Mapping[str, Any]) -> Params:
    try:
        return Params.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ParamsError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
