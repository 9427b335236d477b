"""ASAM OpenSCENARIO XML 1.0 to 1.3, with roads of ASAM OpenDRIVE, as scenarios of the simulator."""

from __future__ import annotations

from pipeline.simulation.openscenario.conversion import convert
from pipeline.simulation.openscenario.referenced_files import referenced_files
from pipeline.simulation.openscenario.xml_files import OpenScenarioError

__all__ = ["OpenScenarioError", "convert", "referenced_files"]
