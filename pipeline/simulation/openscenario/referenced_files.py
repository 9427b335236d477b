"""The files that an OpenSCENARIO file refers to, to notice that one was edited."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from pipeline.simulation.openscenario.xml_files import (
    OpenScenarioError,
    XmlElement,
    catalog_paths,
    named_path,
    read_xml,
)


def referenced_files(path: Path) -> Iterator[Path]:
    """Its scenario if it is a distribution of parameter values, the road network and the catalogs, in a fixed order.
    Names that are parameters are left out, as is everything that cannot be read. OSError or ValueError for a folder
    that cannot be listed."""
    try:
        root = read_xml(path, "OpenSCENARIO")
    except OpenScenarioError:
        return
    scenario = root.find("ParameterValueDistribution", "ScenarioFile")
    if scenario is not None:
        file = _named(path, scenario, "filepath")
        yield file
        if file.resolve() != path.resolve():
            yield from _of_scenario(file)
    else:
        yield from _of_scenario(path)


def _of_scenario(path: Path) -> Iterator[Path]:
    try:
        root = read_xml(path, "OpenSCENARIO")
    except OpenScenarioError:
        return
    for each in root.below():
        if each.tag == "LogicFile":
            yield _named(path, each, "filepath")
        elif each.tag == "Directory":
            with suppress(FileNotFoundError):
                yield from catalog_paths(path.parent, each.attributes.get("path", ""))


def _named(path: Path, at: XmlElement, attribute: str) -> Path:
    return named_path(path.parent, at.attributes.get(attribute, ""))
