"""World coordinates of files that were written for CARLA."""

from __future__ import annotations

from pipeline.simulation.openscenario.xml_files import XmlElement

_CARLA = "CARLA:"
"""A description that begins so marks a file whose world positions are CARLA's own: y to the right, headings clockwise
(documentation of CARLA's ScenarioRunner)."""
_NOTE = "World positions are read in CARLA's left-handed coordinates, as the file's description asks for."


def mirror_world_positions(root: XmlElement) -> list[str]:
    """Turn the world positions of a file for CARLA into those of its OpenDRIVE map, in place. Returns a note if that
    was done."""
    header = root.find("FileHeader")
    if header is None or not header.attributes.get("description", "").startswith(_CARLA):
        return []
    for each in root.below():
        if each.tag == "WorldPosition":
            for key in ("y", "h"):
                if key in each.attributes:
                    each.attributes[key] = _negated(each.attributes[key])
    return [_NOTE]


def _negated(value: str) -> str:
    """A number, parameter or expression with the other sign."""
    inner = value[2:-1] if value.startswith("${") and value.endswith("}") else value
    return f"${{-({inner})}}"
