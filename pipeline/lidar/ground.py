"""Ground plane fitting (Zermas, Izzat, Papanikolopoulos 2017, Algorithm 1; paper, Point Cloud Segmentation).

The area is split along the driving direction; in each segment the lowest points seed a plane that is refined
``iterations`` times. The normal is the smallest singular vector of the seeds' covariance. No RANSAC.

Choices that the two papers leave open, made on real 16-channel sweeps:

* The band around the plane narrows from ``seed_height_m`` to ``distance_m`` over the iterations. In print it is narrow
  from the second one on, and then keeps to the strip of a tilted road that its lowest points came from.
* Segments hold equal numbers of points, not equal lengths: rings of the road lie ever further apart with distance.
* The least ragged plane is taken for the road: the side of a truck, or the ego's own body, also holds a plane, but its
  points fill the whole band around it and are few of what is there, and others lie below it. In order of raggedness
  each plane must meet those before it, at their common edge or, across a more ragged one, halfway between them: a plane
  that a hedge beside the car tilts meets the road behind, but not the one ahead.
* A plane that does not, that is too steep, or that rests on too few or nearly collinear points (a single ring across
  the road) is fitted once more from the neighbour's, which then says what "low" means (a mount may be tilted: Astyx by
  6°), and failing that is the neighbour's.
"""

from __future__ import annotations

import numpy as np

from pipeline.lidar import ground_kernels as kernels
from pipeline.params import GroundParams
from pipeline.types import F32, Mask
from pipeline.types import Ground as Ground


def no_higher_than(ground: Ground, points: F32, of: Mask, height_m: float) -> Mask:
    """(N,) bool: the points of the mask ``of`` that are at most this high above the ground, or where no ground was
    fitted."""
    return np.asarray(kernels.no_higher_than(points, of, ground.planes, ground.edges, height_m))


def follow_ground(points: F32, keep: Mask, params: GroundParams, before: Ground | None) -> Ground:
    """As ``fit_ground``, but if a sweep shows too little of the road for a plane, that of the previous sweep goes on.

    A metre behind a truck, the road that is left to see is a few arcs beside the bumper; taken for obstacles, they form
    one cluster with the truck, too large for a vehicle.
    """
    now = fit_ground(points, keep, params)
    if before is None or now.fitted.any() or not np.isfinite(before.planes).any():
        return now
    mask = no_higher_than(before, points, keep, params.distance_m)
    return Ground(mask, before.planes, before.edges, np.zeros_like(before.fitted))


def fit_ground(points: F32, keep: Mask, params: GroundParams) -> Ground:
    """Planes of the road, and which points lie on it.

    points: (N, 4) float32 ``x y z intensity``, ego frame, finite. keep: (N,) bool, the points to use. A point is ground
    if it is at most ``distance_m`` above its segment's plane: points below the road (a ditch, a reflection in a puddle)
    are no obstacles either.
    """
    return Ground(
        *kernels.ground(
            points,
            keep,
            params.segments,
            params.iterations,
            params.lowest_points,
            params.seed_height_m,
            params.distance_m,
            np.cos(np.radians(params.max_slope_deg)),
            params.fit_range_m,
            params.fit_half_width_m,
            params.min_range_m,
        )
    )
