"""The mesh of every kind of actor."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from pipeline.simulation.drawing import people_meshes, vehicle_meshes
from pipeline.simulation.drawing.mesh_builder import Mesh, MeshBuilder
from pipeline.simulation.world.actors import ActorKind

_SHAPES: dict[ActorKind, Callable[[MeshBuilder, float, float, float], None]] = {
    "car": vehicle_meshes.car,
    "van": vehicle_meshes.van,
    "truck": vehicle_meshes.truck,
    "bus": vehicle_meshes.bus,
    "motorcycle": vehicle_meshes.motorcycle,
    "bicycle": people_meshes.bicycle,
    "pedestrian": people_meshes.pedestrian,
}


@lru_cache(maxsize=64)
def mesh(kind: ActorKind, size_m: tuple[float, float, float]) -> Mesh:
    """The mesh of a kind of actor at a length, width and height."""
    builder = MeshBuilder()
    _SHAPES[kind](builder, *size_m)
    return builder.build()
