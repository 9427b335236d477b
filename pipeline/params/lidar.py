"""Parameters of the LiDAR branch, stage by stage."""

from __future__ import annotations

from typing import Literal

from pipeline.params.declare import Section, choice, slider


class DeskewParams(Section):
    """Motion compensation of the sweep by own speed and yaw rate."""

    enabled: bool = choice(False, "Put points where what stands would be at the tick; what drives along is distorted")


class DownsampleParams(Section):
    """Per-channel down-sampling (paper: "down-sampling … points of each channel")."""

    blind_range_m: float = slider(1.0, 0.0, 5.0, 0.1, "m", "Nearer returns come from the own body and are dropped")
    keep_every: int = slider(1, 1, 10, 1, "points", "Keep every n-th point of each channel; 1 keeps all")


class GroundParams(Section):
    """Ground plane fitting (Zermas 2017; paper, Point Cloud Segmentation)."""

    segments: int = slider(3, 1, 8, 1, "", "Segments along the driving direction, each with a plane of its own")
    iterations: int = slider(5, 1, 20, 1, "", "N_iter: refinements of each plane")
    lowest_points: int = slider(200, 10, 2000, 10, "points", "N_LPR: lowest points averaged for the seed height")
    seed_height_m: float = slider(0.6, 0.05, 2.0, 0.05, "m", "Th_seeds: height above the lowest points of a seed")
    distance_m: float = slider(0.25, 0.02, 1.0, 0.01, "m", "Th_dist: a point this near the plane is ground")
    max_slope_deg: float = slider(10.0, 1.0, 30.0, 0.5, "°", "A plane steeper than this falls back to its neighbour")
    fit_range_m: float = slider(50.0, 10.0, 100.0, 5.0, "m", "Planes are fitted to points this far ahead and behind")
    fit_half_width_m: float = slider(10.0, 2.0, 30.0, 0.5, "m", "Planes are fitted to points this far to either side")
    min_range_m: float = slider(2.0, 0.0, 5.0, 0.1, "m", "No plane is fitted to nearer returns: the own body")


class ClusterParams(Section):
    """Exact Euclidean clustering with a weight on z (paper, Point Cloud Segmentation)."""

    tolerance_m: float = slider(0.9, 0.1, 3.0, 0.05, "m", "Points nearer than this are one object")
    z_weight: float = slider(0.4, 0.05, 1.0, 0.05, "", "Weight on height: below 1 joins rings that lie 2° apart")
    min_points: int = slider(4, 1, 50, 1, "points", "Smaller clusters are dropped")
    max_points: int = slider(20000, 100, 50000, 100, "points", "Larger clusters are dropped")
    max_range_m: float = slider(70.0, 10.0, 120.0, 1.0, "m", "Points beyond this are not clustered")
    max_height_m: float = slider(3.0, 0.5, 6.0, 0.1, "m", "Points higher than this above the ground are left out")
    front_only: bool = choice(True, "Use the front 180° only (the sensor sits in the bumper)")


class BoxParams(Section):
    """Oriented boxes around clusters."""

    method: Literal["axis_aligned", "l_shape"] = choice(
        "l_shape", "axis_aligned: sides along ego x and y; l_shape: the turn whose sides lie closest to the points"
    )
    yaw_step_deg: float = slider(2.0, 0.5, 10.0, 0.5, "°", "Step of the search for the best turn")
    ground_gap_m: float = slider(1.2, 0.0, 3.0, 0.1, "m", "A cluster that ends nearer the ground stands on it")


class LidarTrackingParams(Section):
    """Recursive Bayes over clusters (paper: Markov assumption, gates on distance, count, density, spread)."""

    filter: Literal["trajectory", "kalman"] = choice(
        "kalman", "trajectory: velocity from the last positions (paper); kalman: constant-velocity filter"
    )
    gate_m: float = slider(2.5, 0.2, 10.0, 0.1, "m", "A cluster further from the predicted place is another object")
    max_count_ratio: float = slider(4.0, 1.1, 20.0, 0.1, "", "Largest ratio of point counts of the same object")
    max_density_ratio: float = slider(6.0, 1.1, 50.0, 0.1, "", "Largest ratio of point densities")
    max_spread_change_m: float = slider(1.5, 0.1, 5.0, 0.1, "m", "Largest change of the spread along any axis")
    max_missed_s: float = slider(0.6, 0.0, 3.0, 0.1, "s", "A track not seen for longer ends")
    carry_hits: int = slider(3, 1, 20, 1, "frames", "A track seen fewer times ends when a sweep lacks it")
    accel_sigma_mps2: float = slider(3.0, 0.1, 20.0, 0.1, "m/s²", "Kalman: how hard objects may accelerate")
    position_sigma_m: float = slider(0.15, 0.01, 2.0, 0.01, "m", "Kalman: noise of a cluster's position")
    start_speed_mps: float = slider(15.0, 1.0, 60.0, 1.0, "m/s", "How fast a new object may move; widens its gate")
    trajectory_frames: int = slider(5, 2, 20, 1, "frames", "trajectory: positions that the velocity is fitted to")
