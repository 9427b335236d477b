"""Parameters of longitudinal control: adaptive cruise control and emergency braking."""

from __future__ import annotations

from pipeline.params.declare import Section, choice, slider


class AccParams(Section):
    """Adaptive cruise control (paper, Algorithm 3 and Eq. 6, with their errors corrected)."""

    set_speed_kmh: float = slider(100.0, 10.0, 200.0, 5.0, "km/h", "Target speed with nothing ahead")
    min_gap_m: float = slider(5.0, 1.0, 20.0, 0.5, "m", "d_min: gap at standstill")
    time_gap_s: float = slider(1.8, 0.8, 4.0, 0.1, "s", "d_desired = d_min + time gap × speed")
    ttc_limit_s: float = slider(2.5, 0.5, 10.0, 0.1, "s", "Slow down for any object with a shorter TTC")
    confirm_frames: int = slider(
        2,
        1,
        10,
        1,
        "frames",
        "Consecutive frames on a collision course before ACC slows for an object beside the path, and as the CIPV "
        "before it brakes harder than is comfortable",
    )
    speed_hits: int = slider(
        2,
        1,
        20,
        1,
        "frames",
        "An object of unknown speed is assumed to stand, for braking beyond comfort, from this many detections on; 1: "
        "at once",
    )
    kp: float = slider(2.0, 0.0, 5.0, 0.05, "1/s", "PID: proportional gain")
    ki: float = slider(0.05, 0.0, 2.0, 0.01, "1/s²", "PID: integral gain")
    kd: float = slider(0.0, 0.0, 2.0, 0.01, "", "PID: derivative gain")
    max_accel_mps2: float = slider(2.0, 0.5, 5.0, 0.1, "m/s²", "Acceleration at full accelerator")
    max_decel_mps2: float = slider(8.0, 1.0, 10.0, 0.1, "m/s²", "Deceleration at full brake")
    comfort_decel_mps2: float = slider(
        3.5,
        0.5,
        10.0,
        0.1,
        "m/s²",
        "Hardest ACC braking, unless avoiding a collision takes more and evidence is strong (ISO 15622: 3.5 at speed)",
    )
    comfort_jerk_mps3: float = slider(
        2.5,
        0.0,
        20.0,
        0.1,
        "m/s³",
        "Deceleration grows at most this fast above 20 m/s, and twice as fast below 5 m/s (ISO 15622), unless avoiding "
        "a collision takes more; 0: no limit",
    )
    approach_decel_mps2: float = slider(
        2.5,
        0.0,
        10.0,
        0.1,
        "m/s²",
        "Slow down for a lead beyond the desired gap once this deceleration is needed; 0: only at the gap (paper)",
    )
    gap_sigmas: float = slider(
        1.0,
        0.0,
        3.0,
        0.1,
        "σ",
        "Slow down for a short gap only beyond this many standard deviations of the distance, and do not speed up "
        "behind a lead that may be too near; 0: as if distances had no error (paper)",
    )
    brake_limit_mps2: float = slider(
        8.0,
        0.0,
        10.0,
        0.1,
        "m/s²",
        "Hardest braking by ACC; ISO 15622 permits 3.5 at speed, 0 leaves all braking to AEB",
    )


class AebParams(Section):
    """Emergency braking beside ACC. A stage starts when the time to collision falls below its limit or the required
    deceleration exceeds its limit."""

    enabled: bool = choice(True, "Warn and brake in an emergency; off: ACC only, as in the paper")
    min_speed_kmh: float = slider(5.0, 0.0, 30.0, 1.0, "km/h", "No stage starts below this ego speed")
    warn_ttc_s: float = slider(2.2, 0.5, 6.0, 0.1, "s", "Warn below this time to collision")
    partial_ttc_s: float = slider(1.4, 0.3, 4.0, 0.1, "s", "Partial braking below this time to collision")
    full_ttc_s: float = slider(0.9, 0.2, 3.0, 0.1, "s", "Full braking below this time to collision")
    partial_when_mps2: float = slider(4.0, 1.0, 10.0, 0.1, "m/s²", "Partial braking above this required deceleration")
    full_when_mps2: float = slider(5.5, 1.0, 10.0, 0.1, "m/s²", "Full braking above this required deceleration")
    partial_decel_mps2: float = slider(4.0, 0.5, 8.0, 0.1, "m/s²", "Deceleration of partial braking")
    full_decel_mps2: float = slider(8.0, 2.0, 10.0, 0.1, "m/s²", "Deceleration of full braking")
    build_up_s: float = slider(
        0.3, 0.0, 1.0, 0.05, "s", "Delay from brake command to full pressure, counted as unbraked"
    )
    margin_m: float = slider(1.0, 0.0, 5.0, 0.1, "m", "Remaining gap after braking")
    closing_sigmas: float = slider(
        1.0,
        0.0,
        3.0,
        0.1,
        "σ",
        "What only the camera sees requires the deceleration for a closing speed this many standard deviations lower; "
        "0: for the estimated one",
    )
    react_to_present: bool = choice(
        True,
        "Emergency braking, and ACC when it brakes harder than is comfortable, react to what is in the path only if "
        "this frame too shows it there; off: if all its detections together do",
    )
    react_where_met: bool = choice(
        True,
        "ACC and emergency braking react to oncoming traffic only if it is in the path where the two meet; off: also "
        "if it crosses the path before",
    )
    react_to_crossing: bool = choice(
        True,
        "ACC and emergency braking react to what crosses as soon as its front is sure to enter the path before the car "
        "is there, and to persons who step in; off: only once the middle of its side would, and it surely moves",
    )
    confirm_frames: int = slider(2, 1, 10, 1, "frames", "Consecutive frames that must request a stage before it starts")
    release_ttc_s: float = slider(6.0, 1.0, 20.0, 0.5, "s", "Keep braking below this time to collision")
    release_s: float = slider(0.3, 0.0, 3.0, 0.1, "s", "Braking ends this long after the danger has passed")
    standstill_s: float = slider(2.0, 0.0, 10.0, 0.5, "s", "Hold the brakes for this long at standstill")
