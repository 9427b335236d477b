"""Parameters of own motion, the path, the choice of the lead, and time."""

from __future__ import annotations

from typing import Literal

from pipeline.params.declare import Section, choice, slider


class MotionParams(Section):
    """Source of ego motion, how long it is used after its last measurement, and when an object counts as moving."""

    source: Literal["auto", "can", "gnss", "lidar", "off"] = choice(
        "auto",
        "Source of ego motion. auto: the best recorded source, or LiDAR odometry where speed or yaw rate is missing; "
        "can: vehicle bus, odometry or IMU only; gnss: GNSS receiver only; lidar: LiDAR odometry, checked against what "
        "is recorded; off: none",
    )
    moving_mps: float = slider(1.5, 0.1, 10.0, 0.1, "m/s", "Speed over ground above which an object is moving")
    coast_s: float = slider(
        2.0, 0.0, 5.0, 0.1, "s", "How long ACC and AEB keep using the last ego speed once it is no longer measured"
    )
    coast_accel_mps2: float = slider(1.0, 0.1, 5.0, 0.1, "m/s²", "Assumed change of ego speed while it is not measured")
    coast_turn_radps2: float = slider(
        0.03, 0.001, 0.2, 0.001, "rad/s²", "Assumed change of the yaw rate while it is not measured"
    )
    keep_over_ground: bool = choice(
        True,
        "From sweep to sweep, the LiDAR's objects keep their velocity over the ground; off: their velocity relative to "
        "the car, also while it turns or brakes",
    )


class PathParams(Section):
    """The ego corridor: which sources shape it, and how far each is trusted."""

    half_width_m: float = slider(1.5, 0.5, 4.0, 0.05, "m", "Half the width of the corridor without lane lines")
    length_m: float = slider(100.0, 20.0, 200.0, 5.0, "m", "Length of the corridor")
    use_lanes: bool = choice(True, "Align the corridor with the lane lines where they are visible")
    use_gnss: bool = choice(True, "Align the corridor with the planned route where GNSS locates the car on it")
    use_yaw_rate: bool = choice(True, "Curve the corridor according to the yaw rate")
    use_edges: bool = choice(
        True,
        "Align the corridor with the edges of the road (kerbs, hedges, walls, rails, parked cars) where no lane lines "
        "or route show the road",
    )
    use_drivable: bool = choice(
        True,
        "Align the corridor with the drivable area that the lane network finds where no lane lines or route show the "
        "road",
    )
    use_corners: bool = choice(
        True, "Where no lane lines or route show the road, a slow car may turn before what stands ahead of it"
    )
    use_traffic: bool = choice(
        True,
        "Align the corridor with the headings of other vehicles where no lane lines or route show the road",
    )
    min_speed_mps: float = slider(2.0, 0.0, 10.0, 0.5, "m/s", "Yaw rate and GNSS course are ignored below this speed")
    yaw_rate_sigma_radps: float = slider(
        0.007, 0.0005, 0.05, 0.0005, "rad/s", "Noise of the yaw rate, including small steering corrections"
    )
    lateral_jerk_mps3: float = slider(
        0.8, 0.05, 3.0, 0.05, "m/s³", "Largest lateral jerk of a road: limits how far ahead an arc is valid"
    )
    lateral_accel_mps2: float = slider(
        1.5,
        0.1,
        6.0,
        0.1,
        "m/s²",
        "Lateral acceleration that a road may cause while the path is assumed to be straight",
    )
    lane_keeping_sigma_m: float = slider(0.2, 0.0, 1.0, 0.05, "m", "Usual distance from the lane's centre")
    lane_keeping_sigma_mps: float = slider(0.1, 0.0, 1.0, 0.05, "m/s", "Usual lateral speed within the lane")
    route_reach_m: float = slider(
        8.0, 1.0, 50.0, 1.0, "m", "The car counts as off the route beyond this distance from it"
    )
    gnss_gate_sigmas: float = slider(3.7, 1.0, 10.0, 0.1, "σ", "Fixes farther from the predicted position are rejected")
    gnss_restart_s: float = slider(
        2.0, 0.2, 30.0, 0.1, "s", "Accept fixes again, with more uncertainty, after rejecting them for this long"
    )
    outlier_sigmas: float = slider(3.0, 1.0, 10.0, 0.1, "σ", "Sources that deviate from the others by more are ignored")
    smoothing_s: float = slider(
        0.2, 0.0, 2.0, 0.05, "s", "Time constant with which the corridor follows its sources; 0: no smoothing"
    )
    good_sigma_m: float = slider(
        1.0, 0.1, 3.0, 0.1, "m", "The path is usable as far ahead as its sigma stays below this"
    )
    usable_s: float = slider(
        1.5, 0.2, 5.0, 0.1, "s", "ACC accelerates only if the path is usable for this travel time ahead"
    )


class LaneParams(Section):
    """Lane lines: mapping from the image to the road, and tracking."""

    max_range_m: float = slider(60.0, 15.0, 100.0, 5.0, "m", "Lane markings beyond this distance are ignored")
    mount_height_m: float = slider(
        0.6, 0.0, 3.0, 0.05, "m", "Height of the ego origin above the road where neither LiDAR nor calibration gives it"
    )
    bearing_sigma_deg: float = slider(0.1, 0.01, 1.0, 0.01, "°", "Noise of a point's direction in the image")
    min_quality: float = slider(0.3, 0.05, 0.95, 0.01, "", "Lines of lower quality are ignored")
    min_width_m: float = slider(2.4, 1.5, 4.0, 0.1, "m", "Narrowest lane")
    max_width_m: float = slider(4.8, 3.0, 8.0, 0.1, "m", "Widest lane")
    max_heading_deg: float = slider(7.0, 1.0, 30.0, 0.5, "°", "Largest angle between a lane line and the car")
    gate_m: float = slider(0.7, 0.1, 2.0, 0.05, "m", "Largest distance of a line from its prediction")
    max_age_s: float = slider(1.0, 0.1, 5.0, 0.1, "s", "A line is dropped after this long without a detection")
    pitch_sigma_deg: float = slider(0.8, 0.0, 3.0, 0.1, "°", "Uncertainty of the calibrated camera pitch")
    pitch_drift_deg: float = slider(0.15, 0.01, 2.0, 0.01, "°/√s", "How fast the pitch drifts with load and suspension")


class CipvParams(Section):
    """Which objects may be the closest in-path vehicle, and which one is."""

    confirm_hits: int = slider(
        3, 1, 20, 1, "frames", "Detections needed to confirm an object that only one sensor sees"
    )
    confirm_lead: bool = choice(
        True, "A lead with fewer detections than that leads only while a sensor sees it; off: also while it is carried"
    )
    carried_may_become_lead: bool = choice(False, "Let an object that is not seen in this frame become the CIPV")
    hysteresis_m: float = slider(0.3, 0.0, 2.0, 0.05, "m", "The lead stays in the path up to this far outside its edge")
    min_overlap_m: float = slider(
        0.9,
        0.0,
        2.0,
        0.05,
        "m",
        "In path: at least this much of the object's width is inside the corridor, or half of a narrower object",
    )
    use_flank: bool = choice(
        True, "Camera-only vehicles beside the path: locate the rear, not the middle of a box that shows a flank too"
    )
    narrow_along: bool = choice(
        True,
        "What the LiDAR sees drive along the path is as wide as its nearest face; off: or as its camera box, which may "
        "cover several vehicles",
    )
    decide_s: float = slider(
        0.3, 0.0, 2.0, 0.05, "s", "In path: time over which detections are averaged; 0: this frame only"
    )
    forget_at_takeover: bool = choice(
        True,
        "What earlier detections said of an object ends where LiDAR and camera take over from each other at "
        "contradicting distances",
    )
    max_sigma_m: float = slider(4.0, 0.5, 20.0, 0.1, "m", "Largest standard deviation of a lead's lateral position")
    road_goes_on: float = slider(
        0.75,
        0.0,
        0.95,
        0.05,
        "",
        "Vehicles that drive ahead: probability that the road goes on as the path says, within a small part of its "
        "sigma; 0: errors of the path have one normal distribution",
    )
    cut_in_s: float = slider(3.0, 0.5, 6.0, 0.1, "s", "Cut-ins and cut-outs are predicted this far ahead")
    prove_cut_in: bool = choice(
        True,
        "The next lead cuts in if it surely exists, drives and moves towards the path; off: if its estimated lateral "
        "speed leads into the path",
    )
    use_crossing: bool = choice(True, "A crossing object is in the path only if it is still there when the car arrives")
    crossing_margin_s: float = slider(
        1.0,
        0.0,
        5.0,
        0.1,
        "s",
        "A crossing object counts as gone if it clears the path this long before the car arrives",
    )
    min_width_m: float = slider(0.5, 0.1, 3.0, 0.1, "m", "LiDAR-only objects: smallest width")
    min_height_m: float = slider(0.5, 0.1, 3.0, 0.1, "m", "LiDAR-only objects: smallest height")
    max_size_m: float = slider(
        15.0, 3.0, 40.0, 0.5, "m", "LiDAR-only objects: largest extent; excludes walls and hedges"
    )
    max_short_side_m: float = slider(
        4.5,
        2.0,
        40.0,
        0.5,
        "m",
        "LiDAR-only objects: largest shorter side; a larger one holds several vehicles. From max_size_m on, no limit",
    )
    become_existence: float = slider(
        0.7, 0.0, 0.95, 0.01, "", "To become the lead, an object must exist with at least this probability"
    )
    become_probability: float = slider(
        0.5,
        0.0,
        0.95,
        0.01,
        "",
        "To become the lead, an object must exist and be in the path with at least this probability",
    )
    become_camera: float = slider(
        0.7,
        0.0,
        0.95,
        0.01,
        "",
        "The same for an object at the edge of the path that only the camera sees: a track that hops along a row of "
        "parked cars seems to drive ahead",
    )
    become_standing: float = slider(
        0.8,
        0.0,
        0.95,
        0.01,
        "",
        "The same for a vehicle that may be standing: far more are parked beside the path than stopped in it",
    )
    become_oncoming: float = slider(
        0.9,
        0.0,
        0.95,
        0.01,
        "",
        "The same for oncoming traffic: it keeps to its lane, but before an unknown bend it may appear to be in ours",
    )
    stay_probability: float = slider(
        0.4, 0.0, 0.95, 0.05, "", "The lead is kept while both probabilities are at least this"
    )
    stay_driving: float = slider(
        0.05,
        0.0,
        0.95,
        0.01,
        "",
        "A lead that was seen to drive in our lane is kept while it is in it with at least this probability: few "
        "vehicles leave their lane",
    )
    stay_standing: float = slider(
        0.6, 0.0, 0.95, 0.05, "", "The same for a lead that may be standing and was never seen to drive"
    )


class TimeParams(Section):
    """Where one clip of a recording ends and the next begins (``pipeline.common.clips``).

    In 1.5 s, a car that brakes or accelerates unseen at 3 m/s² ends up 3.4 m from where it was expected, nearly its own
    length, and one that changes lanes is halfway across. After a longer gap, a track would be a guess."""

    reset_gap_s: float = slider(
        1.5, 0.2, 10.0, 0.1, "s", "All trackers reset after a longer gap, or a jump back in time"
    )


class SyncParams(Section):
    """How live sensors are synchronised; recordings already are."""

    camera_offset_ms: float = slider(
        0.0, -500.0, 500.0, 1.0, "ms", "Added to the camera's timestamps; negative if the camera lags"
    )
    ego_offset_ms: float = slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the timestamps of speed and yaw rate")
    gnss_offset_ms: float = slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the timestamps of GNSS fixes")
    max_skew_ms: float = slider(
        60.0, 5.0, 200.0, 1.0, "ms", "Images farther than this from the sweep in time are ignored"
    )
    wait_ms: float = slider(25.0, 0.0, 100.0, 1.0, "ms", "Longest time that a sweep waits for an image taken after it")
