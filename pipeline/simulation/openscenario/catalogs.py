"""Catalogs: entries by name, with parameters of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipeline.common.files.user_file_errors import reason_of
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import XmlElement, catalog_paths, read_xml, shown

_MOST_CATALOG_FILES = 200
_REFERRING = ("TrajectoryRef", "RouteRef", "AssignRouteAction", "FollowTrajectoryAction")
"""Elements in which a reference stands for a trajectory or route."""


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

    def expanded(self, at: XmlElement, scope: ParameterScope) -> XmlElement:
        """The same element with trajectories and routes of catalogs in the place of the references to them."""
        if at.find("ParameterDeclarations") is not None:
            scope = ParameterScope(scope.values)
            scope.declare(at, {})
        return self.expanded_inside(at, scope)

    def expanded_inside(self, at: XmlElement, scope: ParameterScope) -> XmlElement:
        """The same for an element whose own parameters are in the scope already."""
        children = [
            self._written(child, scope)
            if child.tag == "CatalogReference" and at.tag in _REFERRING
            else self.expanded(child, scope)
            for child in at.children
        ]
        unchanged = all(new is old for new, old in zip(children, at.children, strict=True))
        return at if unchanged else replace(at, children=children)

    def _written(self, reference: XmlElement, scope: ParameterScope) -> XmlElement:
        """An entry with the values of its parameters written out."""
        found, inner = self.entry(reference, scope)
        return self.expanded_inside(_with_values(found, inner), inner)

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


def _with_values(at: XmlElement, scope: ParameterScope) -> XmlElement:
    """The same without declarations of parameters, and with their values in the place of their names."""
    attributes = {name: scope.text(at, name) for name in at.attributes}
    children = [_with_values(each, scope) for each in at.children if each.tag != "ParameterDeclarations"]
    return replace(at, attributes=attributes, children=children)
