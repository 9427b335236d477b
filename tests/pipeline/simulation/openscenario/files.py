"""Small OpenSCENARIO and OpenDRIVE files, put together from parts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.simulation import scenario
from pipeline.simulation.scenario import Scenario

LANE_M = 3.5


def lane(number: int, kind: str = "driving", width: float = LANE_M, mark: str = "solid") -> str:
    return (
        f'<lane id="{number}" type="{kind}"><width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
        f'<roadMark sOffset="0" type="{mark}"/></lane>'
    )


STRAIGHT = '<geometry s="0" x="0" y="0" hdg="0" length="2000"><line/></geometry>'
RIGHT = f"<right>{lane(-1)}{lane(-2)}{lane(-3, 'shoulder', 1.5)}</right>"
LEFT = f"<left>{lane(1)}</left>"


def xodr(plan: str = STRAIGHT, lanes: str = LEFT + RIGHT, inside: str = "", more: str = "", of_road: str = "") -> str:
    """A file with road 7. inside: further elements of the road; more: further roads; of_road: its attributes."""
    return (
        f'<OpenDRIVE><road id="7" length="2000" junction="-1" {of_road}><planView>{plan}</planView>{inside}'
        f'<lanes><laneSection s="0">{lanes}</laneSection></lanes></road>{more}</OpenDRIVE>'
    )


BEND = xodr(
    '<geometry s="0" x="0" y="0" hdg="0" length="400"><line/></geometry>'
    '<geometry s="400" x="400" y="0" hdg="0" length="100"><spiral curvStart="0" curvEnd="0.002"/></geometry>'
)
"""A road that begins to bend."""


def vehicle(kind: str = "car", length: float = 4.0, width: float = 2.0, centre: float = 1.5) -> str:
    return (
        f'<Vehicle name="v" vehicleCategory="{kind}"><BoundingBox><Center x="{centre}" y="0" z="0.7"/>'
        f'<Dimensions length="{length}" width="{width}" height="1.5"/></BoundingBox></Vehicle>'
    )


def entity(name: str, body: str = "", controller: str = "") -> str:
    return f'<ScenarioObject name="{name}">{body or vehicle()}{controller}</ScenarioObject>'


def speed_action(target: str, shape: str = "step", value: float = 0.0, dimension: str = "time") -> str:
    """target: a number, or the element of a relative target."""
    wanted = target if target.startswith("<") else f'<AbsoluteTargetSpeed value="{target}"/>'
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        f'<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'
        f"<SpeedActionTarget>{wanted}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"
    )


def lane_action(target: str, shape: str = "sinusoidal", value: float = 4.0, dimension: str = "time") -> str:
    return (
        '<PrivateAction><LateralAction><LaneChangeAction targetLaneOffset="0">'
        f'<LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"
    )


def on_lane(number: int, s: float, offset: float = 0.0, inside: str = "") -> str:
    return f'<LanePosition roadId="7" laneId="{number}" s="{s}" offset="{offset}">{inside}</LanePosition>'


def init(name: str, position: str, speed: str | None = None, more: str = "") -> str:
    teleport = f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"
    moving = speed_action(speed) if speed is not None else ""
    return f'<Private entityRef="{name}">{teleport}{moving}{more}</Private>'


def condition(inside: str, delay: float = 0.0, edge: str = "none") -> str:
    """One group with one condition."""
    return (
        f'<ConditionGroup><Condition name="c" delay="{delay}" conditionEdge="{edge}">{inside}</Condition>'
        "</ConditionGroup>"
    )


def by_value(inside: str) -> str:
    return f"<ByValueCondition>{inside}</ByValueCondition>"


def at_time(seconds: float) -> str:
    return by_value(f'<SimulationTimeCondition value="{seconds}" rule="greaterOrEqual"/>')


def by_entity(inside: str, *names: str, rule: str = "any") -> str:
    who = "".join(f'<EntityRef entityRef="{name}"/>' for name in names or ("Ego",))
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{who}</TriggeringEntities>'
        f"<EntityCondition>{inside}</EntityCondition></ByEntityCondition>"
    )


def event(name: str, action: str, start: str = "", priority: str = "parallel", more: str = "") -> str:
    trigger = f"<StartTrigger>{start}</StartTrigger>" if start else ""
    inside = f'<Action name="a_{name}">{action}</Action>{trigger}'
    return f'<Event name="{name}" priority="{priority}" {more}>{inside}</Event>'


def story(*events: str, actors: str = "Lead", of_act: str = "", of_group: str = "") -> str:
    """One story with one act, maneuver group and maneuver. of_act: its triggers."""
    refs = "".join(f'<EntityRef entityRef="{name}"/>' for name in actors.split())
    return (
        f'<Story name="s"><Act name="act"><ManeuverGroup name="g" maximumExecutionCount="1" {of_group}>'
        f'<Actors selectTriggeringEntities="false">{refs}</Actors>'
        f'<Maneuver name="m">{"".join(events)}</Maneuver></ManeuverGroup>{of_act}</Act></Story>'
    )


@dataclass
class Parts:
    """The parts of a file: by default, the ego vehicle follows a car that is 50 m ahead."""

    parameters: str = ""
    variables: str = ""
    catalogs: str = ""
    entities: str = entity("Ego") + entity("Lead")
    init: str = init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, 150.0), "20")
    stories: str = ""
    stop: str = condition(at_time(10.0))
    road: str = xodr()

    def xosc(self) -> str:
        parameters = f"<ParameterDeclarations>{self.parameters}</ParameterDeclarations>" if self.parameters else ""
        variables = f"<VariableDeclarations>{self.variables}</VariableDeclarations>" if self.variables else ""
        return (
            f'<OpenSCENARIO><FileHeader revMajor="1" revMinor="2"/>{parameters}{variables}'
            f"<CatalogLocations>{self.catalogs}</CatalogLocations>"
            '<RoadNetwork><LogicFile filepath="road.xodr"/></RoadNetwork>'
            f"<Entities>{self.entities}</Entities><Storyboard><Init><Actions>{self.init}</Actions></Init>"
            f"{self.stories}<StopTrigger>{self.stop}</StopTrigger></Storyboard></OpenSCENARIO>"
        )

    def write(self, folder: Path) -> Path:
        """The scenario, with its road beside it."""
        (folder / "road.xodr").write_text(self.road, encoding="utf-8")
        path = folder / "drive.xosc"
        path.write_text(self.xosc(), encoding="utf-8")
        return path

    def load(self, folder: Path, options: str = "") -> Scenario:
        return scenario.load(f"{self.write(folder)}{options}")


def declared(name: str, value: str, kind: str = "double", inside: str = "") -> str:
    return f'<ParameterDeclaration name="{name}" parameterType="{kind}" value="{value}">{inside}</ParameterDeclaration>'
