"""Parameters of the camera branch, of the alignment of camera and LiDAR, and of their fusion."""

from __future__ import annotations

from typing import Literal

from pipeline.params.declare import Section, choice, slider


class DetectionParams(Section):
    """Which of the detector's boxes are kept."""

    far_view: bool = choice(
        True, "Use the boxes of the second pass over the far part of the image, at native resolution"
    )
    min_score: float = slider(0.3, 0.05, 0.95, 0.01, "", "Boxes with a lower score are dropped")
    nms_iou: float = slider(
        0.55, 0.1, 0.95, 0.01, "", "Of two boxes that overlap more, the one with the lower score is dropped"
    )
    road_users_only: bool = choice(
        True, "Drop boxes of classes that no road user belongs to, such as suitcases and traffic lights"
    )
    car_prior: float = slider(
        1.5, 1.0, 5.0, 0.1, "", "A vehicle is a car unless another class scores this many times higher"
    )


class DistanceParams(Section):
    """Power law d = a·h^b from the box height in pixels (paper, Distance Estimation with Regression). Unset values come
    from the law of the detector that drew the boxes (``pipeline.types.DistanceLaw``). The preset ``paper`` uses the
    printed law."""

    coefficient: float | None = slider(
        None, 100.0, 10000.0, 1.0, "", "a, for a camera of the reference focal length; unset: the detector's own"
    )
    exponent: float | None = slider(
        None, -2.0, -0.5, 0.001, "", "b; −1 is an ideal pinhole camera (paper: −1.093); unset: the detector's own"
    )
    reference_focal_px: float = slider(
        907.0,
        100.0,
        5000.0,
        1.0,
        "px",
        "Focal length that a refers to; box heights are scaled to it. 907 px is 720p with a 78° diagonal",
    )
    scale_to_camera: bool = choice(
        True, "Scale box heights by the camera's focal length; off: the law is already for this camera"
    )
    depth_along_axis: bool = choice(
        True, "The law gives depth along the optical axis, and range follows from the bearing; off: it gives range"
    )
    per_class: bool = choice(True, "Separate laws for trucks, buses and motorcycles; off: one law, as in the paper")
    truck_ratio: float | None = slider(
        None, 0.5, 4.0, 0.05, "", "Height of a truck's box relative to a car's; unset: the detector's own"
    )
    bus_ratio: float | None = slider(
        None, 0.5, 4.0, 0.05, "", "Height of a bus's box relative to a car's; unset: the detector's own"
    )
    motorcycle_ratio: float | None = slider(
        None, 0.3, 4.0, 0.05, "", "Height of a motorcycle's box relative to a car's; unset: the detector's own"
    )
    binning: bool = choice(False, "Round estimates to bins of 10 m between 5 and 60 m, as in the paper")
    max_m: float = slider(120.0, 20.0, 200.0, 1.0, "m", "Estimates beyond this are discarded (paper: 60)")
    height_sigma_px: float = slider(
        2.0, 0.2, 20.0, 0.1, "px", "Noise of a box's height; determines the sigma of the distance"
    )
    size_spread: float = slider(
        0.2,
        0.0,
        0.5,
        0.01,
        "",
        "Relative spread of heights within a class, and of how tightly a network's boxes fit. Measured on four "
        "labelled drives: 0.10 to 0.18, around a median that is off by up to 0.11",
    )


class VisionTrackingParams(Section):
    """Box tracking over the last frames (paper, Algorithm 1, with its errors corrected)."""

    filter: Literal["queue", "kalman"] = choice(
        "kalman", "queue: newest box of each id (paper); kalman: filtered position"
    )
    queue_frames: int = slider(10, 1, 30, 1, "frames", "A box is dropped after this many frames without a detection")
    max_missed_s: float = slider(1.0, 0.1, 5.0, 0.1, "s", "A box is dropped after this long without a detection")
    gate_px: float = slider(80.0, 5.0, 400.0, 1.0, "px", "dist_th: largest movement of a box's centre between frames")
    gate_sizes: float = slider(1.0, 0.1, 5.0, 0.1, "", "kalman: largest movement in box widths, if that is more")
    gate_sigmas: float = slider(
        4.0, 1.0, 10.0, 0.1, "σ", "kalman: a box farther from the expected position and size is another object"
    )
    max_size_ratio: float = slider(2.0, 1.1, 5.0, 0.1, "", "kalman: largest change of a box's width between sightings")
    shift_px: float = slider(
        4.0, 0.0, 40.0, 0.5, "px", "kalman: how far the whole image may shift between frames, as the car pitches"
    )
    bearing_sigma_deg: float = slider(0.3, 0.05, 3.0, 0.05, "°", "kalman: noise of a box's direction")
    accel_sigma_mps2: float = slider(3.0, 0.1, 20.0, 0.1, "m/s²", "kalman: acceleration noise of objects")
    learn_height: bool = choice(
        True, "kalman: learn a vehicle's height while the LiDAR ranges it; off: assume that of its class"
    )
    forget_heights: bool = choice(
        True,
        "kalman: a height is forgotten if the cluster by which it was learned turns out to be another vehicle's; off: "
        "it is kept",
    )
    use_aspect: bool = choice(
        True, "kalman: a car whose box is tall for its width is taken for a van; off: assume the height of its class"
    )
    max_nis: float = slider(
        13.8,
        3.0,
        1000.0,
        0.1,
        "",
        "kalman: largest NIS of a distance; 13.8 is the 99.9 % quantile of χ² (2 degrees of freedom)",
    )
    restart_after: int = slider(
        3, 1, 30, 1, "frames", "kalman: consecutive rejected distances after which a track's position is reset"
    )
    ghost_iou: float = slider(
        0.4, 0.1, 1.0, 0.05, "", "kalman: a carried box that overlaps a detected one by more is dropped"
    )


class AlignmentParams(Section):
    """The model that projects LiDAR points into the image. Unset values come from the recording's calibration."""

    model: Literal["angular", "pinhole"] = choice("pinhole", "angular: h_res and v_res (paper); pinhole: calibration")
    h_res_deg: float | None = slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel across")
    v_res_deg: float | None = slider(None, 0.005, 0.3, 0.0001, "°/px", "angular: degrees per pixel down")
    cx_px: float | None = slider(
        None, -2000.0, 8000.0, 1.0, "px", "angular: image column of the direction straight ahead"
    )
    cy_px: float | None = slider(None, -2000.0, 8000.0, 1.0, "px", "angular: image row at the LiDAR's height")
    yaw_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: turns the mount to the left")
    pitch_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: turns the mount downwards")
    roll_deg: float = slider(0.0, -10.0, 10.0, 0.05, "°", "pinhole: turns the mount clockwise")
    forward_m: float = slider(0.0, -1.0, 1.0, 0.01, "m", "pinhole: shifts the camera forwards")
    left_m: float = slider(0.0, -1.0, 1.0, 0.01, "m", "pinhole: shifts the camera to the left")
    up_m: float = slider(0.0, -1.0, 1.0, 0.01, "m", "pinhole: shifts the camera upwards")
    zoom: float = slider(1.0, 0.7, 1.4, 0.001, "", "pinhole: factor on the calibration's focal length")


class ExistenceParams(Section):
    """Whether an object exists: evidence from both sensors for and against it."""

    enabled: bool = choice(True, "Weigh the evidence for and against each object; off: every object exists")
    use_missing_boxes: bool = choice(
        True, "Count against an object of the LiDAR alone that the camera looks at it and sees no vehicle"
    )
    forget_at_takeover: bool = choice(
        True,
        "What the LiDAR said for and against an object ends where LiDAR and camera take over from each other at "
        "contradicting distances",
    )
    min_braking: float = slider(
        0.8,
        0.0,
        0.99,
        0.01,
        "",
        "An object that is less likely to exist causes only gentle deceleration, no hard braking; so does an object "
        "seen by the camera alone that is less likely to be in the path",
    )
    camera_ranges: int = slider(
        8,
        1,
        50,
        1,
        "frames",
        "Consecutive camera distances after which a closing speed may cause hard braking without LiDAR",
    )


class FusionParams(Section):
    """Which LiDAR and camera tracks are one object (paper, Algorithm 2, with its errors corrected)."""

    assignment: Literal["greedy", "optimal"] = choice(
        "optimal", "greedy: each box takes its best free cluster (paper); optimal: best total overlap, one-to-one"
    )
    min_iou: float = slider(0.1, 0.0, 0.9, 0.01, "", "Boxes that overlap by less are separate objects")
    ring_gap_deg: float = slider(
        2.0, 0.0, 4.0, 0.1, "°", "Angle between rings: an object is assumed to reach half a gap beyond its last ring"
    )
    range_gate: bool = choice(True, "Do not join tracks whose distances disagree by more than their uncertainty")
    sure_iou: float = slider(
        0.3,
        0.1,
        1.0,
        0.05,
        "",
        "Boxes that overlap by more skip the range gate: a car 1.8 times as far away cannot overlap this much",
    )
    range_gate_sigmas: float = slider(
        1.5,
        0.5,
        10.0,
        0.1,
        "σ",
        "Largest difference between the two distances; 1.5 σ of a box's distance is 30 % of it",
    )
    merged_clusters: bool = choice(
        True,
        "Range a box by the points inside it where their cluster is longer than any vehicle, such as car and hedge",
    )
    single_returns: bool = choice(
        True, "Range far vehicles by single LiDAR returns inside their boxes, too few for a cluster"
    )
    roof_share: float = slider(
        0.12,
        0.0,
        0.5,
        0.01,
        "",
        "In this uppermost part of a box, returns that are farther than the camera says were seen over the roof; 0: "
        "they range the vehicle",
    )
    use_ground_contact: bool = choice(
        True,
        "kalman: correct a box's distance by where the box meets the road that the LiDAR measures; off: by its height",
    )
    keep_partners: bool = choice(
        True, "A box stays with the cluster that it was joined with, unless another one fits clearly better"
    )
    settled_boxes: bool = choice(
        True,
        "A cluster seen once contradicts no vehicle that the camera has ranged three times: they are joined only if "
        "their distances agree, however well they overlap (only with range_gate)",
    )
    size_gate: bool = choice(
        True, "Do not join a box with a cluster longer than any vehicle of its class: hedges, walls, rails"
    )
    drift_s: float = slider(
        60.0, 5.0, 120.0, 1.0, "s", "Time over which vehicles and lines are compared to detect a turned mount"
    )
    drift_sigmas: float = slider(
        4.0, 2.0, 10.0, 0.1, "σ", "A turned mount is reported when its angle is this many standard deviations from zero"
    )
    disagree_s: float = slider(2.0, 0.2, 10.0, 0.1, "s", "Time over which disagreement of camera and LiDAR is averaged")
    disagree_share: float = slider(
        0.25,
        0.05,
        1.0,
        0.05,
        "",
        "ACC will not accelerate if camera and LiDAR disagree about more than this share of cars",
    )
