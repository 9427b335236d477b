"""Parameters of the LiDAR branch, stage by stage."""

from __future__ import annotations

from typing import Literal

from pipeline.params.declare import Section, choice, slider


class DeskewParams(Section):
    """Motion compensation of the sweep by ego speed and yaw rate."""

    enabled: bool = choice(False, "Correct points for ego motion during the sweep; distorts moving vehicles")


class DownsampleParams(Section):
    """Per-channel down-sampling (paper: "down-sampling … points of each channel")."""

    blind_range_m: float = slider(
        1.0,
        0.0,
        5.0,
        0.1,
        "m",
        "Nearer returns, unless from ahead of the bumper, come from the ego vehicle and are dropped",
    )
    keep_every: int = slider(1, 1, 10, 1, "points", "Keep every n-th point of each channel; 1 keeps all")


class GroundParams(Section):
    """Ground plane fitting (Zermas 2017; paper, Point Cloud Segmentation)."""

    segments: int = slider(3, 1, 8, 1, "", "Segments along the driving direction, each with its own plane")
    iterations: int = slider(5, 1, 20, 1, "", "N_iter: refinements of each plane")
    lowest_points: int = slider(
        200, 10, 2000, 10, "points", "N_LPR: number of lowest points averaged for the seed height"
    )
    seed_height_m: float = slider(
        0.6, 0.05, 2.0, 0.05, "m", "Th_seeds: points up to this far above the lowest ones are seeds"
    )
    distance_m: float = slider(
        0.25, 0.02, 1.0, 0.01, "m", "Th_dist: points within this distance of the plane are ground"
    )
    max_slope_deg: float = slider(
        10.0, 1.0, 30.0, 0.5, "°", "A steeper plane is replaced by that of the neighbouring segment"
    )
    fit_range_m: float = slider(
        50.0, 10.0, 100.0, 5.0, "m", "Planes are fitted to points within this distance ahead and behind"
    )
    fit_half_width_m: float = slider(
        10.0, 2.0, 30.0, 0.5, "m", "Planes are fitted to points within this distance to either side"
    )
    min_range_m: float = slider(
        2.0, 0.0, 5.0, 0.1, "m", "Returns nearer than this come from the ego vehicle and are not used for the fit"
    )


class ClusterParams(Section):
    """Exact Euclidean clustering with a weight on z (paper, Point Cloud Segmentation)."""

    tolerance_m: float = slider(0.9, 0.1, 3.0, 0.05, "m", "Points closer together than this belong to one cluster")
    divide_m: float = slider(
        0.7, 0.1, 3.0, 0.05, "m", "Tolerance within a cluster that is wider than any vehicle; equal to tolerance_m: off"
    )
    divide_tracked: bool = choice(True, "Divide a cluster that covers two tracked objects that move apart")
    divide_nearer: bool = choice(
        True,
        "Divide a cluster that reaches 0.5 m nearer than the rear of a tracked vehicle that drives ahead (only with "
        "divide_tracked)",
    )
    z_weight: float = slider(0.4, 0.05, 1.0, 0.05, "", "Weight on height: below 1 joins rings that are 2° apart")
    min_points: int = slider(4, 1, 50, 1, "points", "Clusters with fewer points are dropped")
    max_points: int = slider(20000, 100, 50000, 100, "points", "Clusters with more points are dropped")
    max_range_m: float = slider(70.0, 10.0, 120.0, 1.0, "m", "Points beyond this distance are not clustered")
    max_height_m: float = slider(3.0, 0.5, 6.0, 0.1, "m", "Points higher than this above the ground are ignored")
    front_only: bool = choice(True, "Use only the front 180° (the sensor is mounted in the bumper)")


class BoxParams(Section):
    """Oriented boxes around clusters."""

    method: Literal["axis_aligned", "l_shape"] = choice(
        "l_shape", "axis_aligned: sides along ego x and y; l_shape: the yaw whose sides are closest to the points"
    )
    yaw_step_deg: float = slider(2.0, 0.5, 10.0, 0.5, "°", "Step size of the search for the best yaw")
    ground_gap_m: float = slider(
        1.2, 0.0, 3.0, 0.1, "m", "A cluster that ends this close above the ground is extended down to it"
    )


class LidarTrackingParams(Section):
    """Recursive Bayes over clusters (paper: Markov assumption, gates on distance, count, density, spread)."""

    filter: Literal["trajectory", "kalman"] = choice(
        "kalman", "trajectory: velocity from the last positions (paper); kalman: constant-velocity filter"
    )
    gate_m: float = slider(2.5, 0.2, 10.0, 0.1, "m", "Largest distance of a cluster from the predicted position")
    max_count_ratio: float = slider(4.0, 1.1, 20.0, 0.1, "", "Largest ratio of point counts between sightings")
    max_density_ratio: float = slider(6.0, 1.1, 50.0, 0.1, "", "Largest ratio of point densities between sightings")
    max_spread_change_m: float = slider(
        1.5, 0.1, 5.0, 0.1, "m", "Largest change of the spread of points along any axis"
    )
    max_missed_s: float = slider(0.6, 0.0, 3.0, 0.1, "s", "A track is dropped after this long without a sighting")
    carry_hits: int = slider(
        3, 1, 20, 1, "frames", "A track with fewer sightings is dropped as soon as a sweep misses it"
    )
    accel_sigma_mps2: float = slider(3.0, 0.1, 20.0, 0.1, "m/s²", "kalman: acceleration noise of objects")
    position_sigma_m: float = slider(0.15, 0.01, 2.0, 0.01, "m", "kalman: noise of a cluster's position")
    start_speed_mps: float = slider(15.0, 1.0, 60.0, 1.0, "m/s", "Speed uncertainty of a new object; widens its gate")
    trajectory_frames: int = slider(
        5, 2, 20, 1, "frames", "trajectory: number of positions that the velocity is fitted to"
    )
    rigid_sideways: bool = choice(
        True, "An object moves sideways only as far as both of its sides do; off: a growing footprint counts as motion"
    )
    cut_off_is_no_motion: bool = choice(
        True,
        "If a part of a footprint is cut off, its speed follows the side that stays; off: the jump counts as motion",
    )
