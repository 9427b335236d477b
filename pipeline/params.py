"""Every tunable of the line, declared once: default, bounds, step, unit and help.

From this one place come the sliders of the page, ``--set`` and ``--params`` of the command line, the API's schema and
the preset files. People read and type degrees; the stages turn them into radians where they use them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import BadInput


class ParamsError(BadInput):
    """A parameter that does not exist or a value out of its bounds; the text names it."""


def _slider(default: float | int | None, low: float, high: float, step: float, unit: str, text: str) -> Any:
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"step": step, "unit": unit})


def _choice(default: Any, text: str) -> Any:
    return Field(default, description=text)


class Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class DeskewParams(Section):
    """Motion compensation of the sweep by own speed and yaw rate."""

    enabled: bool = _choice(False, "Put points where what stands would be at the tick; what drives along is distorted")


class DownsampleParams(Section):
    """Per-channel down-sampling (paper: "down-sampling … points of each channel")."""

    blind_range_m: float = _slider(1.0, 0.0, 5.0, 0.1, "m", "Nearer returns come from the own body and are dropped")
    keep_every: int = _slider(1, 1, 10, 1, "points", "Keep every n-th point of each channel; 1 keeps all")


class GroundParams(Section):
    """Ground plane fitting (Zermas 2017; paper, Point Cloud Segmentation)."""

    segments: int = _slider(3, 1, 8, 1, "", "Segments along the driving direction, each with a plane of its own")
    iterations: int = _slider(5, 1, 20, 1, "", "N_iter: refinements of each plane")
    lowest_points: int = _slider(200, 10, 2000, 10, "points", "N_LPR: lowest points averaged for the seed height")
    seed_height_m: float = _slider(0.6, 0.05, 2.0, 0.05, "m", "Th_seeds: height above the lowest points of a seed")
    distance_m: float = _slider(0.25, 0.02, 1.0, 0.01, "m", "Th_dist: a point this near the plane is ground")
    max_slope_deg: float = _slider(10.0, 1.0, 30.0, 0.5, "°", "A plane steeper than this falls back to its neighbour")
    fit_range_m: float = _slider(50.0, 10.0, 100.0, 5.0, "m", "Planes are fitted to points this far ahead and behind")
    fit_half_width_m: float = _slider(10.0, 2.0, 30.0, 0.5, "m", "Planes are fitted to points this far to either side")
    min_range_m: float = _slider(2.0, 0.0, 5.0, 0.1, "m", "No plane is fitted to nearer returns: the own body")


class ClusterParams(Section):
    """Exact Euclidean clustering with a weight on z (paper, Point Cloud Segmentation)."""

    tolerance_m: float = _slider(0.9, 0.1, 3.0, 0.05, "m", "Points nearer than this are one object")
    z_weight: float = _slider(0.4, 0.05, 1.0, 0.05, "", "Weight on height: below 1 joins rings that lie 2° apart")
    min_points: int = _slider(4, 1, 50, 1, "points", "Smaller clusters are dropped")
    max_points: int = _slider(20000, 100, 50000, 100, "points", "Larger clusters are dropped")
    max_range_m: float = _slider(70.0, 10.0, 120.0, 1.0, "m", "Points beyond this are not clustered")
    max_height_m: float = _slider(3.0, 0.5, 6.0, 0.1, "m", "Points higher than this above the ground are left out")
    front_only: bool = _choice(True, "Use the front 180° only (the sensor sits in the bumper)")


class BoxParams(Section):
    """Oriented boxes around clusters."""

    method: Literal["axis_aligned", "l_shape"] = _choice(
        "l_shape", "axis_aligned: sides along ego x and y; l_shape: the turn whose sides lie closest to the points"
    )
    yaw_step_deg: float = _slider(2.0, 0.5, 10.0, 0.5, "°", "Step of the search for the best turn")
    ground_gap_m: float = _slider(1.2, 0.0, 3.0, 0.1, "m", "A cluster that ends nearer the ground stands on it")


class LidarTrackingParams(Section):
    """Recursive Bayes over clusters (paper: Markov assumption, gates on distance, count, density, spread)."""

    filter: Literal["trajectory", "kalman"] = _choice(
        "kalman", "trajectory: velocity from the last positions (paper); kalman: constant-velocity filter"
    )
    gate_m: float = _slider(2.5, 0.2, 10.0, 0.1, "m", "A cluster further from the predicted place is another object")
    max_count_ratio: float = _slider(4.0, 1.1, 20.0, 0.1, "", "Largest ratio of point counts of the same object")
    max_density_ratio: float = _slider(6.0, 1.1, 50.0, 0.1, "", "Largest ratio of point densities")
    max_spread_change_m: float = _slider(1.5, 0.1, 5.0, 0.1, "m", "Largest change of the spread along any axis")
    max_missed_s: float = _slider(0.6, 0.0, 3.0, 0.1, "s", "A track not seen for longer ends")
    carry_hits: int = _slider(3, 1, 20, 1, "frames", "A track seen fewer times ends when a sweep lacks it")
    accel_sigma_mps2: float = _slider(3.0, 0.1, 20.0, 0.1, "m/s²", "Kalman: how hard objects may accelerate")
    position_sigma_m: float = _slider(0.15, 0.01, 2.0, 0.01, "m", "Kalman: noise of a cluster's position")
    start_speed_mps: float = _slider(15.0, 1.0, 60.0, 1.0, "m/s", "How fast a new object may move; widens its gate")
    trajectory_frames: int = _slider(5, 2, 20, 1, "frames", "trajectory: positions that the velocity is fitted to")


class DetectionParams(Section):
    """What is kept of the detector's boxes."""

    min_score: float = _slider(0.3, 0.05, 0.95, 0.01, "", "Boxes scored lower are dropped")
    nms_iou: float = _slider(0.55, 0.1, 0.95, 0.01, "", "Of two boxes overlapping more, the lower score is dropped")
    car_prior: float = _slider(
        1.5, 1.0, 5.0, 0.1, "", "A vehicle is a car unless another class scores this many times more"
    )


class DistanceParams(Section):
    """Power law d = a·h^b from the box height in pixels (paper, Distance Estimation with Regression).

    The default is a pinhole camera's law, b = −1, with a fitted by ``pipeline.calibration.distance`` to 38 labelled
    cars of two real cameras (Astyx 047–051 and 057–059, KITTI 2011_09_26 drive 0052): cars 1.59 m tall. The printed
    law is in the preset ``paper``.
    """

    coefficient: float = _slider(1444.0, 100.0, 10000.0, 1.0, "", "a, for a camera of the reference focal length")
    exponent: float = _slider(-1.0, -2.0, -0.5, 0.001, "", "b; −1 is a pinhole camera's (print: −1.093)")
    reference_focal_px: float = _slider(
        907.0,
        100.0,
        5000.0,
        1.0,
        "px",
        "Focal length the law was fitted at; box heights are scaled to it. 907 px is 720p with a 78° diagonal",
    )
    scale_to_camera: bool = _choice(
        True, "Scale box heights by the camera's focal length (off: the law is this camera's)"
    )
    depth_along_axis: bool = _choice(True, "The law gives depth along the optical axis; range follows from the bearing")
    per_class: bool = _choice(True, "Trucks, buses and motorcycles have laws of their own; off: cars only, as in print")
    truck_ratio: float = _slider(1.6, 0.5, 4.0, 0.05, "", "Height of a truck, in cars")
    bus_ratio: float = _slider(2.0, 0.5, 4.0, 0.05, "", "Height of a bus, in cars")
    motorcycle_ratio: float = _slider(0.75, 0.3, 4.0, 0.05, "", "Height of a motorcycle without its rider, in cars")
    binning: bool = _choice(False, "Round estimates to bins of 10 m between 5 and 60 m, as in print")
    max_m: float = _slider(120.0, 20.0, 200.0, 1.0, "m", "Estimates beyond this are discarded (print: 60)")
    height_sigma_px: float = _slider(2.0, 0.2, 20.0, 0.1, "px", "Noise of a box's height: it sets the distance's sigma")
    size_spread: float = _slider(0.1, 0.0, 0.5, 0.01, "", "How much real heights within a class differ, as a share")


class VisionTrackingParams(Section):
    """Box tracking over the last frames (paper, Algorithm 1, with its slips mended)."""

    filter: Literal["queue", "kalman"] = _choice(
        "kalman", "queue: newest box of each id (paper); kalman: filtered place"
    )
    queue_frames: int = _slider(10, 1, 30, 1, "frames", "A box not seen for this many frames ends")
    max_missed_s: float = _slider(1.0, 0.1, 5.0, 0.1, "s", "A box not seen for longer ends")
    gate_px: float = _slider(80.0, 5.0, 400.0, 1.0, "px", "dist_th: largest move of a box's centre between frames")
    gate_sizes: float = _slider(1.0, 0.1, 5.0, 0.1, "", "kalman: largest move, in box widths, where that is more")
    max_size_ratio: float = _slider(2.0, 1.1, 5.0, 0.1, "", "kalman: largest change of a box's width between sightings")
    bearing_sigma_deg: float = _slider(0.3, 0.05, 3.0, 0.05, "°", "Kalman: noise of a box's direction")
    accel_sigma_mps2: float = _slider(3.0, 0.1, 20.0, 0.1, "m/s²", "Kalman: how hard objects may accelerate")
    ghost_iou: float = _slider(0.4, 0.1, 1.0, 0.05, "", "kalman: a carried box this much on a seen one is dropped")


class AlignmentParams(Section):
    """Which model places LiDAR points in the picture, and its numbers. Null: taken from the recording's calibration."""

    model: Literal["angular", "pinhole"] = _choice("pinhole", "angular: h_res and v_res (paper); pinhole: calibration")
    h_res_deg: float | None = _slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel across")
    v_res_deg: float | None = _slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel down")
    cx_px: float | None = _slider(None, -2000.0, 8000.0, 1.0, "px", "angular: column that looks straight ahead")
    cy_px: float | None = _slider(None, -2000.0, 8000.0, 1.0, "px", "angular: row at the LiDAR's own height")
    yaw_deg: float = _slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount to the left")
    pitch_deg: float = _slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount downwards")
    roll_deg: float = _slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount clockwise")


class FusionParams(Section):
    """Which LiDAR and which vision object are one (paper, Algorithm 2, with its slips mended)."""

    assignment: Literal["greedy", "optimal"] = _choice(
        "optimal", "greedy: each vision box takes its best free partner (paper); optimal: best total, one-to-one"
    )
    min_iou: float = _slider(0.1, 0.0, 0.9, 0.01, "", "Boxes overlapping less are two objects")
    ring_gap_deg: float = _slider(
        2.0, 0.0, 4.0, 0.1, "°", "Angle between rings: an object's edge is taken half a gap beyond the last ring on it"
    )
    range_gate: bool = _choice(True, "Do not join objects whose distances disagree beyond their uncertainty")
    sure_iou: float = _slider(
        0.3,
        0.1,
        1.0,
        0.05,
        "",
        "Boxes overlapping more are one object: of cars 1.8 times as far they cannot",
    )
    range_gate_sigmas: float = _slider(3.0, 0.5, 10.0, 0.1, "σ", "Largest disagreement of the two distances")


class MotionParams(Section):
    """What counts as moving."""

    moving_mps: float = _slider(1.5, 0.1, 10.0, 0.1, "m/s", "Speed over ground above which an object is moving")


class PathParams(Section):
    """The ego corridor: which sources bend it, and what each is worth."""

    half_width_m: float = _slider(1.5, 0.5, 4.0, 0.05, "m", "Half the width of the corridor where no lane lines say it")
    length_m: float = _slider(100.0, 20.0, 200.0, 5.0, "m", "How far ahead the corridor is drawn")
    use_lanes: bool = _choice(True, "Lay the corridor between the lane lines where they are seen")
    use_gnss: bool = _choice(True, "Lay the corridor along the route where one is given and GNSS says where we are")
    use_yaw_rate: bool = _choice(True, "Bend the corridor with the yaw rate where it is known")
    min_speed_mps: float = _slider(2.0, 0.0, 10.0, 0.5, "m/s", "Below this speed yaw rate and course say nothing")
    yaw_rate_sigma_radps: float = _slider(
        0.007, 0.0005, 0.05, 0.0005, "rad/s", "Noise of one yaw rate, the driver's small corrections included"
    )
    lateral_jerk_mps3: float = _slider(
        0.5, 0.05, 3.0, 0.05, "m/s³", "How fast a road's lateral acceleration changes: sets how far an arc is good for"
    )
    lateral_accel_mps2: float = _slider(
        1.5, 0.1, 6.0, 0.1, "m/s²", "Lateral acceleration that a straight guess leaves open"
    )
    lane_keeping_sigma_m: float = _slider(0.2, 0.0, 1.0, 0.05, "m", "How far a driver is off the middle of the lane")
    lane_keeping_sigma_mps: float = _slider(0.1, 0.0, 1.0, 0.05, "m/s", "Sideways speed within the lane")
    route_reach_m: float = _slider(8.0, 1.0, 50.0, 1.0, "m", "Farther from the route than this we are not on it")
    gnss_gate_sigmas: float = _slider(3.7, 1.0, 10.0, 0.1, "σ", "A fix farther from the expected place is refused")
    gnss_restart_s: float = _slider(2.0, 0.2, 30.0, 0.1, "s", "Fixes refused for this long are believed, with doubt")
    outlier_sigmas: float = _slider(3.0, 1.0, 10.0, 0.1, "σ", "A source that disagrees more is left out")
    smoothing_s: float = _slider(0.2, 0.0, 2.0, 0.05, "s", "How slowly the corridor follows its sources; 0 at once")
    good_sigma_m: float = _slider(1.0, 0.1, 3.0, 0.1, "m", "The path is good as far as its sigma stays below this")
    usable_s: float = _slider(1.5, 0.2, 5.0, 0.1, "s", "The path must be good for this time ahead to be driven after")


class LaneParams(Section):
    """Lane lines: from the picture to the ground, and over time."""

    max_range_m: float = _slider(60.0, 15.0, 100.0, 5.0, "m", "Paint farther away is left out")
    mount_height_m: float = _slider(
        0.6, 0.0, 3.0, 0.05, "m", "Height of the ego origin above the road, where no sweep shows the road"
    )
    bearing_sigma_deg: float = _slider(0.1, 0.01, 1.0, 0.01, "°", "Noise of a point's direction in the picture")
    min_quality: float = _slider(0.3, 0.05, 0.95, 0.01, "", "Lines supported less are not believed")
    min_width_m: float = _slider(2.4, 1.5, 4.0, 0.1, "m", "Two lines nearer than this are no lane")
    max_width_m: float = _slider(4.8, 3.0, 8.0, 0.1, "m", "Two lines farther apart than this are no lane")
    max_heading_deg: float = _slider(
        7.0, 1.0, 30.0, 0.5, "°", "A line turned further away from the car is no lane line"
    )
    gate_m: float = _slider(0.7, 0.1, 2.0, 0.05, "m", "A line farther from the expected place is another one")
    max_age_s: float = _slider(1.0, 0.1, 5.0, 0.1, "s", "A line not seen for longer ends")
    pitch_sigma_deg: float = _slider(0.8, 0.0, 3.0, 0.1, "°", "How far the camera's pitch may be off its calibration")
    pitch_drift_deg: float = _slider(0.15, 0.01, 2.0, 0.01, "°/√s", "How fast the pitch changes: load and springs")


class CipvParams(Section):
    """Who may be the closest in-path vehicle, and who is."""

    confirm_hits: int = _slider(3, 1, 20, 1, "frames", "Sightings before an object seen by one sensor counts")
    carried_may_become_lead: bool = _choice(False, "An object that is not seen in this frame may take over as CIPV")
    hysteresis_m: float = _slider(0.3, 0.0, 2.0, 0.05, "m", "The lead leaves the path only this far outside it")
    min_overlap_m: float = _slider(
        0.9,
        0.0,
        2.0,
        0.05,
        "m",
        "In path: this much of its width reaches between the edges, or half of what is narrower",
    )
    decide_s: float = _slider(0.3, 0.0, 2.0, 0.05, "s", "In path: over how long sightings are weighed; 0: each alone")
    max_sigma_m: float = _slider(4.0, 0.5, 20.0, 0.1, "m", "A lead's place against the path is no more uncertain")
    cut_in_s: float = _slider(3.0, 0.5, 6.0, 0.1, "s", "Lane crossings are told this long before")
    min_width_m: float = _slider(0.5, 0.1, 3.0, 0.1, "m", "L objects: smallest extent across, a vehicle's rear or side")
    min_height_m: float = _slider(0.5, 0.1, 3.0, 0.1, "m", "L objects: smallest height")
    max_size_m: float = _slider(15.0, 3.0, 40.0, 0.5, "m", "L objects: largest extent; walls and hedges are longer")


class AccParams(Section):
    """Adaptive cruise control (paper, Algorithm 3 and Eq. 6, with its slips mended)."""

    set_speed_kmh: float = _slider(100.0, 10.0, 200.0, 5.0, "km/h", "Speed driven when nothing is ahead")
    min_gap_m: float = _slider(5.0, 1.0, 20.0, 0.5, "m", "d_min: gap at standstill")
    time_gap_s: float = _slider(1.8, 0.8, 4.0, 0.1, "s", "d_desired = d_min + time gap × speed")
    ttc_limit_s: float = _slider(2.5, 0.5, 10.0, 0.1, "s", "Any object closing in faster than this is braked for")
    kp: float = _slider(2.0, 0.0, 5.0, 0.05, "1/s", "PID: proportional gain")
    ki: float = _slider(0.05, 0.0, 2.0, 0.01, "1/s²", "PID: integral gain")
    kd: float = _slider(0.0, 0.0, 2.0, 0.01, "", "PID: derivative gain")
    max_accel_mps2: float = _slider(2.0, 0.5, 5.0, 0.1, "m/s²", "Accelerator pedal at 1")
    max_decel_mps2: float = _slider(8.0, 1.0, 10.0, 0.1, "m/s²", "Brake pedal at 1")
    brake_limit_mps2: float = _slider(
        8.0, 0.0, 10.0, 0.1, "m/s²", "ACC brakes no harder; ISO 15622 permits 3.5 at speed, 0 leaves it all to AEB"
    )


class AebParams(Section):
    """Emergency braking beside ACC: a stage comes in when the time to collision falls below its limit, or when more
    deceleration is needed than its limit."""

    enabled: bool = _choice(True, "Warn and brake in an emergency; off: ACC alone, as in print")
    min_speed_kmh: float = _slider(5.0, 0.0, 30.0, 1.0, "km/h", "Below this own speed no stage comes in")
    warn_ttc_s: float = _slider(2.2, 0.5, 6.0, 0.1, "s", "Warning when the time to collision is shorter")
    partial_ttc_s: float = _slider(1.4, 0.3, 4.0, 0.1, "s", "Partial braking when it is shorter")
    full_ttc_s: float = _slider(0.9, 0.2, 3.0, 0.1, "s", "Full braking when it is shorter")
    partial_when_mps2: float = _slider(4.0, 1.0, 10.0, 0.1, "m/s²", "Partial braking when this much is needed")
    full_when_mps2: float = _slider(5.5, 1.0, 10.0, 0.1, "m/s²", "Full braking when this much is needed")
    partial_decel_mps2: float = _slider(4.0, 0.5, 8.0, 0.1, "m/s²", "How hard partial braking brakes")
    full_decel_mps2: float = _slider(8.0, 2.0, 10.0, 0.1, "m/s²", "How hard full braking brakes")
    build_up_s: float = _slider(0.3, 0.0, 1.0, 0.05, "s", "From the command to full pressure; driven unbraked")
    margin_m: float = _slider(1.0, 0.0, 5.0, 0.1, "m", "Gap that braking shall leave")
    confirm_frames: int = _slider(2, 1, 10, 1, "frames", "A stage must be asked for in this many frames in a row")
    release_ttc_s: float = _slider(6.0, 1.0, 20.0, 0.5, "s", "Braking goes on while the time to collision is shorter")
    release_s: float = _slider(0.3, 0.0, 3.0, 0.1, "s", "Braking ends when the danger has been gone for this long")
    standstill_s: float = _slider(2.0, 0.0, 10.0, 0.5, "s", "The brakes hold for this long at standstill")


class TimeParams(Section):
    """Gaps in a recording."""

    reset_gap_s: float = _slider(
        1.5, 0.2, 10.0, 0.1, "s", "After a longer gap, or a jump back, every tracker starts anew"
    )


class SyncParams(Section):
    """How live sensors are put together; recordings are together already."""

    camera_offset_ms: float = _slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the camera's times: negative, it lags")
    ego_offset_ms: float = _slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the times of speed and yaw rate")
    gnss_offset_ms: float = _slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the times of GNSS fixes")
    max_skew_ms: float = _slider(60.0, 5.0, 200.0, 1.0, "ms", "A picture farther than this from the sweep is left out")
    wait_ms: float = _slider(
        25.0, 0.0, 100.0, 1.0, "ms", "A sweep waits this long at most for a picture taken after it"
    )


class Params(Section):
    """All parameters of the line, by stage."""

    deskew: DeskewParams = DeskewParams()
    downsample: DownsampleParams = DownsampleParams()
    ground: GroundParams = GroundParams()
    cluster: ClusterParams = ClusterParams()
    box: BoxParams = BoxParams()
    lidar_tracking: LidarTrackingParams = LidarTrackingParams()
    detection: DetectionParams = DetectionParams()
    distance: DistanceParams = DistanceParams()
    vision_tracking: VisionTrackingParams = VisionTrackingParams()
    alignment: AlignmentParams = AlignmentParams()
    fusion: FusionParams = FusionParams()
    motion: MotionParams = MotionParams()
    lanes: LaneParams = LaneParams()
    path: PathParams = PathParams()
    cipv: CipvParams = CipvParams()
    acc: AccParams = AccParams()
    aeb: AebParams = AebParams()
    time: TimeParams = TimeParams()
    sync: SyncParams = SyncParams()


PRESETS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "default": {},
    "paper": {
        "box": {"method": "axis_aligned"},
        "lidar_tracking": {"filter": "trajectory"},
        "detection": {"car_prior": 1.0},
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
        "fusion": {"assignment": "greedy", "min_iou": 0.0, "ring_gap_deg": 0.0, "range_gate": False},
        "cipv": {"confirm_hits": 1, "carried_may_become_lead": True, "hysteresis_m": 0.0, "decide_s": 0.0},
        "aeb": {"enabled": False},
    },
}
"""What a preset changes against the declared defaults."""


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
            raise ParamsError(f"no parameter named {name!r}")
        data[section][key] = value
    return _validated(data)


def from_yaml(path: Path, base: Params) -> Params:
    """``base`` with a preset file's values: a mapping of section to parameter to value."""
    try:
        loaded = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    except OSError as error:
        raise ParamsError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise ParamsError(f"{path}: not a parameter file: {str(error).splitlines()[0]}") from None
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
