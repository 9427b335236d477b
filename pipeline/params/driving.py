"""Parameters of what follows from the objects: path, choice, control; and of time."""

from __future__ import annotations

from pipeline.params.declare import Section, choice, slider


class MotionParams(Section):
    """What counts as moving."""

    moving_mps: float = slider(1.5, 0.1, 10.0, 0.1, "m/s", "Speed over ground above which an object is moving")
    coast_s: float = slider(
        2.0, 0.0, 5.0, 0.1, "s", "ACC and AEB go on with the last own speed for this long when none is measured"
    )
    coast_accel_mps2: float = slider(
        1.0, 0.1, 5.0, 0.1, "m/s²", "How fast an own speed that is not measured may change"
    )
    coast_turn_radps2: float = slider(
        0.03, 0.001, 0.2, 0.001, "rad/s²", "How fast a yaw rate that is not measured may change"
    )


class PathParams(Section):
    """The ego corridor: which sources bend it, and what each is worth."""

    half_width_m: float = slider(1.5, 0.5, 4.0, 0.05, "m", "Half the width of the corridor where no lane lines say it")
    length_m: float = slider(100.0, 20.0, 200.0, 5.0, "m", "How far ahead the corridor is drawn")
    use_lanes: bool = choice(True, "Lay the corridor between the lane lines where they are seen")
    use_gnss: bool = choice(True, "Lay the corridor along the route where one is given and GNSS says where we are")
    use_yaw_rate: bool = choice(True, "Bend the corridor with the yaw rate where it is known")
    min_speed_mps: float = slider(2.0, 0.0, 10.0, 0.5, "m/s", "Below this speed yaw rate and course say nothing")
    yaw_rate_sigma_radps: float = slider(
        0.007, 0.0005, 0.05, 0.0005, "rad/s", "Noise of one yaw rate, the driver's small corrections included"
    )
    lateral_jerk_mps3: float = slider(
        0.8, 0.05, 3.0, 0.05, "m/s³", "How fast a road's lateral acceleration changes: sets how far an arc is good for"
    )
    lateral_accel_mps2: float = slider(
        1.5, 0.1, 6.0, 0.1, "m/s²", "Lateral acceleration that a straight guess leaves open"
    )
    lane_keeping_sigma_m: float = slider(0.2, 0.0, 1.0, 0.05, "m", "How far a driver is off the middle of the lane")
    lane_keeping_sigma_mps: float = slider(0.1, 0.0, 1.0, 0.05, "m/s", "Sideways speed within the lane")
    route_reach_m: float = slider(8.0, 1.0, 50.0, 1.0, "m", "Farther from the route than this we are not on it")
    gnss_gate_sigmas: float = slider(3.7, 1.0, 10.0, 0.1, "σ", "A fix farther from the expected place is refused")
    gnss_restart_s: float = slider(2.0, 0.2, 30.0, 0.1, "s", "Fixes refused for this long are believed, with doubt")
    outlier_sigmas: float = slider(3.0, 1.0, 10.0, 0.1, "σ", "A source that disagrees more is left out")
    smoothing_s: float = slider(0.2, 0.0, 2.0, 0.05, "s", "How slowly the corridor follows its sources; 0 at once")
    good_sigma_m: float = slider(1.0, 0.1, 3.0, 0.1, "m", "The path is good as far as its sigma stays below this")
    usable_s: float = slider(1.5, 0.2, 5.0, 0.1, "s", "The path must be good for this time ahead to be driven after")


class LaneParams(Section):
    """Lane lines: from the picture to the ground, and over time."""

    max_range_m: float = slider(60.0, 15.0, 100.0, 5.0, "m", "Paint farther away is left out")
    mount_height_m: float = slider(
        0.6, 0.0, 3.0, 0.05, "m", "Height of the ego origin above the road, where neither sweep nor calibration knows"
    )
    bearing_sigma_deg: float = slider(0.1, 0.01, 1.0, 0.01, "°", "Noise of a point's direction in the picture")
    min_quality: float = slider(0.3, 0.05, 0.95, 0.01, "", "Lines supported less are not believed")
    min_width_m: float = slider(2.4, 1.5, 4.0, 0.1, "m", "Two lines nearer than this are no lane")
    max_width_m: float = slider(4.8, 3.0, 8.0, 0.1, "m", "Two lines farther apart than this are no lane")
    max_heading_deg: float = slider(7.0, 1.0, 30.0, 0.5, "°", "A line turned further away from the car is no lane line")
    gate_m: float = slider(0.7, 0.1, 2.0, 0.05, "m", "A line farther from the expected place is another one")
    max_age_s: float = slider(1.0, 0.1, 5.0, 0.1, "s", "A line not seen for longer ends")
    pitch_sigma_deg: float = slider(0.8, 0.0, 3.0, 0.1, "°", "How far the camera's pitch may be off its calibration")
    pitch_drift_deg: float = slider(0.15, 0.01, 2.0, 0.01, "°/√s", "How fast the pitch changes: load and springs")


class CipvParams(Section):
    """Who may be the closest in-path vehicle, and who is."""

    confirm_hits: int = slider(3, 1, 20, 1, "frames", "Sightings before an object seen by one sensor counts")
    carried_may_become_lead: bool = choice(False, "An object that is not seen in this frame may take over as CIPV")
    hysteresis_m: float = slider(0.3, 0.0, 2.0, 0.05, "m", "The lead leaves the path only this far outside it")
    min_overlap_m: float = slider(
        0.9,
        0.0,
        2.0,
        0.05,
        "m",
        "In path: this much of its width reaches between the edges, or half of what is narrower",
    )
    decide_s: float = slider(0.3, 0.0, 2.0, 0.05, "s", "In path: over how long sightings are weighed; 0: each alone")
    max_sigma_m: float = slider(4.0, 0.5, 20.0, 0.1, "m", "A lead's place against the path is no more uncertain")
    become_probability: float = slider(
        0.6, 0.0, 0.95, 0.05, "", "A new lead exists, and is in the path, each with at least this probability"
    )
    stay_probability: float = slider(0.4, 0.0, 0.95, 0.05, "", "The lead stays it down to this probability of each")
    cut_in_s: float = slider(3.0, 0.5, 6.0, 0.1, "s", "Lane crossings are told this long before")
    min_width_m: float = slider(0.5, 0.1, 3.0, 0.1, "m", "L objects: smallest extent across, a vehicle's rear or side")
    min_height_m: float = slider(0.5, 0.1, 3.0, 0.1, "m", "L objects: smallest height")
    max_size_m: float = slider(15.0, 3.0, 40.0, 0.5, "m", "L objects: largest extent; walls and hedges are longer")


class AccParams(Section):
    """Adaptive cruise control (paper, Algorithm 3 and Eq. 6, with its slips mended)."""

    set_speed_kmh: float = slider(100.0, 10.0, 200.0, 5.0, "km/h", "Speed driven when nothing is ahead")
    min_gap_m: float = slider(5.0, 1.0, 20.0, 0.5, "m", "d_min: gap at standstill")
    time_gap_s: float = slider(1.8, 0.8, 4.0, 0.1, "s", "d_desired = d_min + time gap × speed")
    ttc_limit_s: float = slider(2.5, 0.5, 10.0, 0.1, "s", "Any object closing in faster than this is braked for")
    kp: float = slider(2.0, 0.0, 5.0, 0.05, "1/s", "PID: proportional gain")
    ki: float = slider(0.05, 0.0, 2.0, 0.01, "1/s²", "PID: integral gain")
    kd: float = slider(0.0, 0.0, 2.0, 0.01, "", "PID: derivative gain")
    max_accel_mps2: float = slider(2.0, 0.5, 5.0, 0.1, "m/s²", "Accelerator pedal at 1")
    max_decel_mps2: float = slider(8.0, 1.0, 10.0, 0.1, "m/s²", "Brake pedal at 1")
    comfort_decel_mps2: float = slider(
        3.5, 0.5, 10.0, 0.1, "m/s²", "ACC brakes no harder for a lead on weak evidence (ISO 15622 permits 3.5 at speed)"
    )
    brake_limit_mps2: float = slider(
        8.0, 0.0, 10.0, 0.1, "m/s²", "ACC brakes no harder; ISO 15622 permits 3.5 at speed, 0 leaves it all to AEB"
    )


class AebParams(Section):
    """Emergency braking beside ACC: a stage comes in when the time to collision falls below its limit, or when more
    deceleration is needed than its limit."""

    enabled: bool = choice(True, "Warn and brake in an emergency; off: ACC alone, as in print")
    min_speed_kmh: float = slider(5.0, 0.0, 30.0, 1.0, "km/h", "Below this own speed no stage comes in")
    warn_ttc_s: float = slider(2.2, 0.5, 6.0, 0.1, "s", "Warning when the time to collision is shorter")
    partial_ttc_s: float = slider(1.4, 0.3, 4.0, 0.1, "s", "Partial braking when it is shorter")
    full_ttc_s: float = slider(0.9, 0.2, 3.0, 0.1, "s", "Full braking when it is shorter")
    partial_when_mps2: float = slider(4.0, 1.0, 10.0, 0.1, "m/s²", "Partial braking when this much is needed")
    full_when_mps2: float = slider(5.5, 1.0, 10.0, 0.1, "m/s²", "Full braking when this much is needed")
    partial_decel_mps2: float = slider(4.0, 0.5, 8.0, 0.1, "m/s²", "How hard partial braking brakes")
    full_decel_mps2: float = slider(8.0, 2.0, 10.0, 0.1, "m/s²", "How hard full braking brakes")
    build_up_s: float = slider(0.3, 0.0, 1.0, 0.05, "s", "From the command to full pressure; driven unbraked")
    margin_m: float = slider(1.0, 0.0, 5.0, 0.1, "m", "Gap that braking shall leave")
    confirm_frames: int = slider(2, 1, 10, 1, "frames", "A stage must be asked for in this many frames in a row")
    release_ttc_s: float = slider(6.0, 1.0, 20.0, 0.5, "s", "Braking goes on while the time to collision is shorter")
    release_s: float = slider(0.3, 0.0, 3.0, 0.1, "s", "Braking ends when the danger has been gone for this long")
    standstill_s: float = slider(2.0, 0.0, 10.0, 0.5, "s", "The brakes hold for this long at standstill")


class TimeParams(Section):
    """Gaps in a recording."""

    reset_gap_s: float = slider(
        1.5, 0.2, 10.0, 0.1, "s", "After a longer gap, or a jump back, every tracker starts anew"
    )


class SyncParams(Section):
    """How live sensors are put together; recordings are together already."""

    camera_offset_ms: float = slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the camera's times: negative, it lags")
    ego_offset_ms: float = slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the times of speed and yaw rate")
    gnss_offset_ms: float = slider(0.0, -500.0, 500.0, 1.0, "ms", "Added to the times of GNSS fixes")
    max_skew_ms: float = slider(60.0, 5.0, 200.0, 1.0, "ms", "A picture farther than this from the sweep is left out")
    wait_ms: float = slider(25.0, 0.0, 100.0, 1.0, "ms", "A sweep waits this long at most for a picture taken after it")
