"""Parameters of the camera branch, of the alignment of camera and LiDAR, and of their fusion."""

from __future__ import annotations

from typing import Literal

from pipeline.params.declare import Section, choice, slider


class DetectionParams(Section):
    """What is kept of the detector's boxes."""

    min_score: float = slider(0.3, 0.05, 0.95, 0.01, "", "Boxes scored lower are dropped")
    nms_iou: float = slider(0.55, 0.1, 0.95, 0.01, "", "Of two boxes overlapping more, the lower score is dropped")
    car_prior: float = slider(
        1.5, 1.0, 5.0, 0.1, "", "A vehicle is a car unless another class scores this many times more"
    )


class DistanceParams(Section):
    """Power law d = a·h^b from the box height in pixels (paper, Distance Estimation with Regression). Null: the law of
    the detector that drew the boxes (``pipeline.types.DistanceLaw``). The printed law is in the preset ``paper``.
    """

    coefficient: float | None = slider(
        None, 100.0, 10000.0, 1.0, "", "a, for a camera of the reference focal length; null: the detector's own"
    )
    exponent: float | None = slider(
        None, -2.0, -0.5, 0.001, "", "b; −1 is a pinhole camera's (print: −1.093); null: the detector's own"
    )
    reference_focal_px: float = slider(
        907.0,
        100.0,
        5000.0,
        1.0,
        "px",
        "Focal length that a is given for; box heights are scaled to it. 907 px is 720p with a 78° diagonal",
    )
    scale_to_camera: bool = choice(
        True, "Scale box heights by the camera's focal length (off: the law is this camera's)"
    )
    depth_along_axis: bool = choice(True, "The law gives depth along the optical axis; range follows from the bearing")
    per_class: bool = choice(True, "Trucks, buses and motorcycles have laws of their own; off: cars only, as in print")
    truck_ratio: float | None = slider(None, 0.5, 4.0, 0.05, "", "Height of a truck's box, in cars; null: as above")
    bus_ratio: float | None = slider(None, 0.5, 4.0, 0.05, "", "Height of a bus's box, in cars; null: as above")
    motorcycle_ratio: float | None = slider(
        None, 0.3, 4.0, 0.05, "", "Height of a motorcycle's box, in cars; null: as above"
    )
    binning: bool = choice(False, "Round estimates to bins of 10 m between 5 and 60 m, as in print")
    max_m: float = slider(120.0, 20.0, 200.0, 1.0, "m", "Estimates beyond this are discarded (print: 60)")
    height_sigma_px: float = slider(2.0, 0.2, 20.0, 0.1, "px", "Noise of a box's height: it sets the distance's sigma")
    size_spread: float = slider(0.1, 0.0, 0.5, 0.01, "", "How much real heights within a class differ, as a share")


class VisionTrackingParams(Section):
    """Box tracking over the last frames (paper, Algorithm 1, with its slips mended)."""

    filter: Literal["queue", "kalman"] = choice(
        "kalman", "queue: newest box of each id (paper); kalman: filtered place"
    )
    queue_frames: int = slider(10, 1, 30, 1, "frames", "A box not seen for this many frames ends")
    max_missed_s: float = slider(1.0, 0.1, 5.0, 0.1, "s", "A box not seen for longer ends")
    gate_px: float = slider(80.0, 5.0, 400.0, 1.0, "px", "dist_th: largest move of a box's centre between frames")
    gate_sizes: float = slider(1.0, 0.1, 5.0, 0.1, "", "kalman: largest move, in box widths, where that is more")
    gate_sigmas: float = slider(
        4.0, 1.0, 10.0, 0.1, "σ", "kalman: a box farther from the expected place and size is another object"
    )
    max_size_ratio: float = slider(2.0, 1.1, 5.0, 0.1, "", "kalman: largest change of a box's width between sightings")
    shift_px: float = slider(
        4.0, 0.0, 40.0, 0.5, "px", "kalman: how far the whole picture may shift between frames, as the car pitches"
    )
    bearing_sigma_deg: float = slider(0.3, 0.05, 3.0, 0.05, "°", "kalman: noise of a box's direction")
    accel_sigma_mps2: float = slider(3.0, 0.1, 20.0, 0.1, "m/s²", "kalman: how hard objects may accelerate")
    max_nis: float = slider(
        13.8, 3.0, 1000.0, 0.1, "", "kalman: a distance more surprising is refused; 13.8 is 99.9 % of χ² (2 degrees)"
    )
    restart_after: int = slider(
        3, 1, 30, 1, "frames", "kalman: distances refused in a row before a track's place is measured anew"
    )
    ghost_iou: float = slider(0.4, 0.1, 1.0, 0.05, "", "kalman: a carried box this much on a seen one is dropped")


class AlignmentParams(Section):
    """Which model places LiDAR points in the picture, and its numbers. Null: taken from the recording's calibration."""

    model: Literal["angular", "pinhole"] = choice("pinhole", "angular: h_res and v_res (paper); pinhole: calibration")
    h_res_deg: float | None = slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel across")
    v_res_deg: float | None = slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel down")
    cx_px: float | None = slider(None, -2000.0, 8000.0, 1.0, "px", "angular: column that looks straight ahead")
    cy_px: float | None = slider(None, -2000.0, 8000.0, 1.0, "px", "angular: row at the LiDAR's own height")
    yaw_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount to the left")
    pitch_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount downwards")
    roll_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: correction of the mount clockwise")


class ExistenceParams(Section):
    """Whether an object is really there: evidence of both sensors for and against it."""

    enabled: bool = choice(True, "Weigh the evidence for and against each object; off: every object exists")
    min_braking: float = slider(
        0.8, 0.0, 0.99, 0.01, "", "An object that exists less probably is slowed down for, but not braked for"
    )
    camera_ranges: int = slider(
        8, 1, 50, 1, "frames", "Distances in a row after which the camera alone knows a closing speed to brake for"
    )


class FusionParams(Section):
    """Which LiDAR and which vision object are one (paper, Algorithm 2, with its slips mended)."""

    assignment: Literal["greedy", "optimal"] = choice(
        "optimal", "greedy: each vision box takes its best free partner (paper); optimal: best total, one-to-one"
    )
    min_iou: float = slider(0.1, 0.0, 0.9, 0.01, "", "Boxes overlapping less are two objects")
    ring_gap_deg: float = slider(
        2.0, 0.0, 4.0, 0.1, "°", "Angle between rings: an object's edge is taken half a gap beyond the last ring on it"
    )
    range_gate: bool = choice(True, "Do not join objects whose distances disagree beyond their uncertainty")
    sure_iou: float = slider(
        0.3,
        0.1,
        1.0,
        0.05,
        "",
        "Boxes overlapping more are one object: of cars 1.8 times as far they cannot",
    )
    range_gate_sigmas: float = slider(3.0, 0.5, 10.0, 0.1, "σ", "Largest disagreement of the two distances")
    size_gate: bool = choice(True, "Do not join a box with what is longer than any of its class: hedges, walls, rails")
    disagree_s: float = slider(2.0, 0.2, 10.0, 0.1, "s", "Over how long camera and LiDAR are compared as a whole")
    disagree_share: float = slider(
        0.25, 0.05, 1.0, 0.05, "", "Cars that lie apart in camera and LiDAR: with a greater share of them nobody drives"
    )
