"""The vehicles of a scenario, written inline or in catalogs, and which of them is the ego vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from pipeline.common.files.user_file_errors import did_you_mean, reason_of
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, catalog_paths, read_xml, shown
from pipeline.simulation.world.actors import ActorKind

_KINDS: dict[str, str] = {"car": "car", "van": "van", "truck": "truck", "bus": "bus", "motorbike": "motorcycle"}
"""``vehicleCategory`` → kind in the simulator."""
_MOST_ENTITIES = 100
_MOST_CATALOG_FILES = 200
_EGO_NAMES = ("ego", "hero")
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

    def refusal(self, why: str = "") -> OpenScenarioError:
        """The error for an entity that the simulator does not have."""
        return self.at.refusal(
            f"entity {shown(self.name)} is a {shown(self.what)}, which is not supported{why}: the simulator has "
            f"{', '.join(_KINDS)}"
        )


class CatalogFiles:
    """The catalogs that a scenario names, read when they are needed."""

    def __init__(self, scenario: XmlElement, scope: ParameterScope, folder: Path) -> None:
        self._folder, self._named = folder, list[tuple[XmlElement, str]]()
        locations = scenario.find("CatalogLocations")
        for kind in locations.children if locations is not None else []:
            for each in kind.all("Directory"):
                self._named.append((each, scope.text(each, "path")))
        self._catalogs: dict[str, XmlElement] | None = None

    def entry(self, reference: XmlElement, scope: ParameterScope) -> tuple[XmlElement, ParameterScope]:
        """The element that a ``CatalogReference`` names, and the scope of its own parameters."""
        catalog, name = scope.text(reference, "catalogName"), scope.text(reference, "entryName")
        if self._catalogs is None:
            self._catalogs = self._read()
        if catalog not in self._catalogs:
            raise reference.refusal(f"no catalog {shown(catalog)!r} in the folders of CatalogLocations")
        for each in self._catalogs[catalog].children:
            if each.attributes.get("name") == name:
                assigned = reference.find("ParameterAssignments")
                given = {
                    scope.text(one, "parameterRef"): scope.text(one, "value")
                    for one in (assigned.all("ParameterAssignment") if assigned is not None else [])
                }
                inner = ParameterScope()
                inner.declare(each, given)
                return each, inner
        raise reference.refusal(f"no entry {shown(name)!r} in catalog {shown(catalog)!r}")

    def _read(self) -> dict[str, XmlElement]:
        found: dict[str, XmlElement] = {}
        for at, name in self._named:
            last = shown(Path(name).name)
            try:
                paths = catalog_paths(self._folder, name)
            except (OSError, ValueError) as error:
                raise at.refusal(f"the catalogs in {last} cannot be read: {reason_of(error)}") from None
            if len(paths) > _MOST_CATALOG_FILES:
                raise at.refusal(f"more than {_MOST_CATALOG_FILES} files in {last}")
            for path in paths:
                catalog = read_xml(path, "OpenSCENARIO").find("Catalog")
                if catalog is not None:
                    found.setdefault(catalog.attributes.get("name", ""), catalog)
        return found


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
    vehicles = [name for name, body in bodies.items() if body.kind is not None]
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
            if bodies[found[0]].kind is None:
                raise bodies[found[0]].refusal()
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
    what = inner.text(shape, "vehicleCategory") if shape.tag == "Vehicle" else shape.tag
    kind = _KINDS.get(what)
    if kind is None:
        return VehicleBody(name, None, what, at, _SMALL_M, 0.0)
    box, centre = shape.one("BoundingBox", "Dimensions"), shape.one("BoundingBox", "Center")
    length, width, height = (inner.number(box, key) for key in ("length", "width", "height"))
    return VehicleBody(name, cast("ActorKind", kind), what, at, (length, width, height), inner.number(centre, "x", 0.0))
