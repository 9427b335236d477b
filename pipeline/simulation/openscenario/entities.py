"""The road users of a scenario, written inline or in catalogs, and which of them is the ego vehicle."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from pipeline.common.files.user_file_errors import did_you_mean
from pipeline.simulation.openscenario.catalogs import CatalogFiles
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.simulation.world.actors import SIZES_M, ActorKind

_KINDS: dict[str, ActorKind] = {
    "car": "car",
    "van": "van",
    "truck": "truck",
    "bus": "bus",
    "motorbike": "motorcycle",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
}
"""``vehicleCategory`` or ``pedestrianCategory`` → kind in the simulator."""
NO_EGO: tuple[ActorKind, ...] = ("bicycle", "pedestrian")
"""Kinds that cannot be the ego vehicle."""
_MOST_ENTITIES = 100
_EGO_NAMES = ("ego", "hero")
_WITH_RIDER_M = 1.4
"""The bounding box of a lower bicycle is without its rider, whom the simulator adds."""
_SMALL_M = (1.0, 1.0, 1.0)
"""Size of what the simulator does not have, for telling whether it is on a driving lane."""


@dataclass(frozen=True)
class VehicleBody:
    """Shape of an entity."""

    name: str
    """Of the entity."""
    kind: ActorKind | None
    """As simulated; None for what the simulator does not have."""
    what: str
    """In the file's words."""
    at: XmlElement
    """In the file."""
    size_m: tuple[float, float, float]
    """Length, width, height."""
    centre_m: float
    """Middle of the vehicle ahead of its reference point, which is the middle of its rear axle."""

    def refusal(self, why: str = "", but: Container[ActorKind] = ()) -> OpenScenarioError:
        """The error for an entity that the simulator does not have, or does not have there. but: kinds that it does
        not have there."""
        known = ", ".join(name for name, kind in _KINDS.items() if kind not in but)
        return self.at.refusal(
            f"entity {shown(self.name)} is a {shown(self.what)}, which is not supported{why}: the simulator has {known}"
        )

    @property
    def can_be_ego(self) -> bool:
        """Whether it is a motor vehicle."""
        return self.kind is not None and self.kind not in NO_EGO


def read_entities(scenario: XmlElement, scope: ParameterScope, catalogs: CatalogFiles) -> dict[str, VehicleBody]:
    """Name → body of every entity."""
    entities = scenario.one("Entities")
    found: dict[str, VehicleBody] = {}
    for each in entities.all("ScenarioObject"):
        name = scope.text(each, "name")
        if name in found or len(found) >= _MOST_ENTITIES:
            raise each.refusal(f"two entities are called {shown(name)!r}, or more than {_MOST_ENTITIES} entities")
        found[name] = _body(each, name, scope, catalogs)
    return found


def ego_name(scenario: XmlElement, bodies: dict[str, VehicleBody], given: str | None) -> tuple[str, str | None]:
    """Which entity is the ego vehicle, and a note if that is a guess: the given one, else the one called Ego or Hero,
    else the one whose name begins so, else the only vehicle, else the only one that a controller drives, else the
    first."""
    if given is not None and given not in bodies:
        raise OpenScenarioError(f"{scenario.file}: ego={shown(given)!r}: no such entity{did_you_mean(given, bodies)}")
    vehicles = [name for name, body in bodies.items() if body.can_be_ego]
    controlled = [name for name in with_controllers(scenario) if name in vehicles]
    choices = (
        [] if given is None else [given],
        [name for name in vehicles if name.lower() in _EGO_NAMES],
        [name for name in vehicles if name.lower().startswith(_EGO_NAMES)],
        vehicles,
        controlled,
    )
    for found in choices:
        if len(found) == 1:
            if not bodies[found[0]].can_be_ego:
                raise bodies[found[0]].refusal(" as the ego vehicle", NO_EGO)
            return found[0], None
    if vehicles:
        return vehicles[0], (
            f"No entity is called Ego, so the first, {shown(vehicles[0])}, is taken for the ego vehicle; choose "
            "another with ?ego=NAME."
        )
    raise next(iter(bodies.values())).refusal() if bodies else scenario.one("Entities").refusal("no entities")


def with_controllers(scenario: XmlElement) -> list[str]:
    """Names of the entities to which the file gives a controller."""
    entities = scenario.one("Entities").all("ScenarioObject")
    return [each.attributes.get("name", "") for each in entities if each.find("ObjectController") is not None]


def _body(at: XmlElement, name: str, scope: ParameterScope, catalogs: CatalogFiles) -> VehicleBody:
    reference = at.find("CatalogReference")
    shape, inner = catalogs.entry(reference, scope) if reference is not None else (None, scope)
    if shape is None:
        shape = next((each for each in at.children if each.tag != "ObjectController"), at)
    category = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}.get(shape.tag)
    what = inner.text(shape, category) if category is not None else shape.tag
    kind = _KINDS.get(what)
    if kind is None:
        return VehicleBody(name, None, what, at, _SMALL_M, 0.0)
    if kind in NO_EGO and shape.find("BoundingBox") is None:
        return VehicleBody(name, kind, what, at, SIZES_M[kind], 0.0)
    box, centre = shape.one("BoundingBox", "Dimensions"), shape.one("BoundingBox", "Center")
    length, width, height = (inner.number(box, key) for key in ("length", "width", "height"))
    if kind == "bicycle" and height < _WITH_RIDER_M:
        height = SIZES_M["bicycle"][2]
    return VehicleBody(name, kind, what, at, (length, width, height), inner.number(centre, "x", 0.0))
