"""Controllers, which are left out: vehicles follow their actions in the storyboard."""

from __future__ import annotations

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_EGO = "The ego vehicle's controller is left out: it follows its actions in the storyboard, or our controller."


def note_controller(at: XmlElement, name: str, scope: ParameterScope, stage: PlayedScenario) -> None:
    """A ``ControllerAction`` or ``ActivateControllerAction``. OpenScenarioError for another vehicle than the ego
    vehicle if a controller that the file gives it takes over its motion: what it would do is not in the file."""
    if name == stage.ego:
        stage.note(_EGO)
        return
    inside = [at] if at.tag == "ActivateControllerAction" else at.children
    for each in inside:
        if each.tag == "AssignControllerAction":
            stage.controlled.add(name)
        takes_over = any(
            scope.truth(each, key, False)
            for key in ("longitudinal", "lateral", "activateLongitudinal", "activateLateral")
        )
        if takes_over and name in stage.controlled:
            raise each.refusal(f"a controller drives {shown(name)}, which is not supported: only the ego vehicle's may")
        if each.tag == "OverrideControllerValueAction" and any(
            scope.truth(pedal, "active", False) for pedal in each.children
        ):
            raise each.refusal(f"OverrideControllerValueAction for {shown(name)} is not supported")
    if name in stage.controlled:
        stage.note(f"The controller of {shown(name)} is left out: it follows its actions in the storyboard.")
