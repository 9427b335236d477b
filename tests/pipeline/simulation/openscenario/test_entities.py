"""Entities: bodies inline and from catalogs, which one is the ego vehicle, and those that are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation.openscenario import referenced_files
from pipeline.simulation.scenario import ScenarioError
from pipeline.simulation.world.actors import SIZES_M
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    declared,
    entity,
    event,
    init,
    on_lane,
    speed_action,
    story,
    vehicle,
)

CATALOGS = '<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>'
REFERENCE = '<CatalogReference catalogName="$catalog" entryName="small">{}</CatalogReference>'
CONTROLLER = '<ObjectController><Controller name="driver"/></ObjectController>'
PEDESTRIAN = '<Pedestrian name="p" pedestrianCategory="pedestrian"/>'


def with_catalog(folder: Path, reference: str = REFERENCE.format("")) -> Parts:
    (folder / "catalogs").mkdir()
    declares = f"<ParameterDeclarations>{declared('height', '1.2')}</ParameterDeclarations>"
    small = vehicle(length=3.0).replace('name="v"', 'name="small"').replace('height="1.5"', 'height="$height"')
    small = small.replace("<BoundingBox>", f"{declares}<BoundingBox>")
    (folder / "catalogs" / "any name.xosc").write_text(
        f'<OpenSCENARIO><Catalog name="cars">{vehicle()}{small}</Catalog></OpenSCENARIO>'
    )
    return Parts(
        parameters=declared("catalog", "cars", "string"),
        catalogs=CATALOGS,
        entities=entity("Ego") + entity("Lead", reference),
    )


@pytest.mark.parametrize(
    ("category", "kind"),
    [("car", "car"), ("van", "van"), ("truck", "truck"), ("bus", "bus"), ("motorbike", "motorcycle")],
)
def test_kind_and_size(category: str, kind: str, tmp_path: Path) -> None:
    body = vehicle(category, 3.3, 1.1)
    (actor,) = Parts(entities=entity("Ego") + entity("Lead", body)).load(tmp_path).actors
    assert (actor.kind, actor.size_m) == (kind, (3.3, 1.1, 1.5))


def test_a_body_from_a_catalog_with_its_own_parameters(tmp_path: Path) -> None:
    assigned = '<ParameterAssignments><ParameterAssignment parameterRef="height" value="{}"/></ParameterAssignments>'
    parts = with_catalog(tmp_path)
    assert parts.load(tmp_path).actors[0].size_m == (3.0, 2.0, 1.2)
    parts.entities = entity("Ego") + entity("Lead", REFERENCE.format(assigned.format("1.4")))
    assert parts.load(tmp_path).actors[0].size_m == (3.0, 2.0, 1.4)


def test_catalogs_that_were_copied_beside_the_scenario(tmp_path: Path) -> None:
    parts = with_catalog(tmp_path)
    (tmp_path / "catalogs" / "any name.xosc").rename(tmp_path / "VehicleCatalog.xosc")
    (tmp_path / "catalogs").rmdir()
    (tmp_path / "other.xosc").write_text("not a catalog, and not XML")
    assert parts.load(tmp_path).actors[0].size_m == (3.0, 2.0, 1.2)
    assert tmp_path / "VehicleCatalog.xosc" in list(referenced_files(tmp_path / "drive.xosc"))


@pytest.mark.parametrize("name", ["Ego", "ego", "EGO", "Hero", "hero", "EgoVehicle", "hero_1"])
def test_the_ego_vehicle_by_its_name(name: str, tmp_path: Path) -> None:
    parts = Parts(
        entities=entity("Lead", controller=CONTROLLER) + entity(name),
        init=init("Lead", on_lane(-1, 150.0), "10") + init(name, on_lane(-1, 100.0), "20"),
    )
    assert parts.load(tmp_path).ego.speed_mps == {0.0: 20.0}


def test_the_ego_vehicle_by_its_controller(tmp_path: Path) -> None:
    parts = Parts(
        entities=entity("A") + entity("B", controller=CONTROLLER),
        init=init("A", on_lane(-1, 150.0), "10") + init("B", on_lane(-1, 100.0), "20"),
    )
    assert parts.load(tmp_path).ego.speed_mps == {0.0: 20.0}


TWO = Parts(
    entities=entity("A") + entity("B"),
    init=init("A", on_lane(-1, 150.0), "10") + init("B", on_lane(-1, 100.0), "20"),
)


def test_without_a_name_or_controller_the_first_is_the_ego_vehicle(tmp_path: Path) -> None:
    made = TWO.load(tmp_path)
    assert made.ego.speed_mps == {0.0: 10.0}
    assert made.notes[0] == (
        "No entity is called Ego, so the first, A, is taken for the ego vehicle; choose another with ?ego=NAME."
    )


def test_the_ego_vehicle_can_be_chosen(tmp_path: Path) -> None:
    made = TWO.load(tmp_path, "?ego=B")
    assert (made.ego.speed_mps, made.notes) == ({0.0: 20.0}, ())
    with pytest.raises(ScenarioError, match="ego='C': no such entity"):
        TWO.load(tmp_path, "?ego=C")


BESIDE = '<LanePosition roadId="7" laneId="-3" s="{}"/>'


WHEELCHAIR = '<Pedestrian name="p" pedestrianCategory="wheelchair"/>'


@pytest.mark.parametrize(("body", "what"), [(WHEELCHAIR, "wheelchair"), ("<MiscObject/>", "MiscObject")])
def test_what_the_simulator_has_not_is_left_out_beside_the_lanes(body: str, what: str, tmp_path: Path) -> None:
    parts = Parts(entities=entity("Ego") + entity("Lead") + entity("X", body))
    parts.init += init("X", BESIDE.format(160.0).replace('s="', 'offset="-0.2" s="'), "0")
    made = parts.load(tmp_path)
    assert len(made.actors) == 1
    assert made.notes == (f"X, a {what} beside the driving lanes, is left out.",)


@pytest.mark.parametrize(
    ("position", "stories", "says"),
    [
        (on_lane(-2, 160.0), "", "entity X is a wheelchair, which is not supported on a driving lane"),
        (
            BESIDE.format(160.0),
            story(event("e", speed_action("2")), actors="X"),
            "entity X is a wheelchair, which is not supported when it acts in the storyboard",
        ),
    ],
)
def test_what_the_simulator_has_not_is_refused_where_it_matters(
    position: str, stories: str, says: str, tmp_path: Path
) -> None:
    parts = Parts(entities=entity("Ego") + entity("Lead") + entity("X", WHEELCHAIR), stories=stories)
    parts.init += init("X", position)
    with pytest.raises(ScenarioError, match=says):
        parts.load(tmp_path)


def test_pedestrians_and_bicycles_are_road_users(tmp_path: Path) -> None:
    """A bicycle's bounding box may be without its rider."""
    parts = Parts(entities=entity("Ego") + entity("Walker", PEDESTRIAN) + entity("Cyclist", vehicle("bicycle")))
    parts.init = (
        init("Ego", on_lane(-1, 100.0), "20")
        + init("Walker", BESIDE.format(160.0), "1.5")
        + init("Cyclist", on_lane(-1, 150.0), "5")
    )
    parts.entities = parts.entities.replace('height="1.5"', 'height="1.1"', 3)
    walker, cyclist = parts.load(tmp_path).actors
    assert (walker.kind, walker.size(), walker.speed_mps) == ("pedestrian", SIZES_M["pedestrian"], {0.0: 1.5})
    assert (cyclist.kind, cyclist.size()) == ("bicycle", (4.0, 2.0, SIZES_M["bicycle"][2]))


@pytest.mark.parametrize("body", [PEDESTRIAN, vehicle("bicycle")])
def test_a_pedestrian_or_bicycle_is_no_ego_vehicle(body: str, tmp_path: Path) -> None:
    parts = Parts(entities=entity("Ego", body) + entity("Car"))
    parts.init = init("Ego", on_lane(-1, 150.0), "2") + init("Car", on_lane(-1, 100.0), "20")
    assert parts.load(tmp_path).ego.speed_mps == {0.0: 20.0}
    with pytest.raises(ScenarioError, match=r"as the ego vehicle: the simulator has car, .*, motorbike$"):
        parts.load(tmp_path, "?ego=Ego")


@pytest.mark.parametrize(
    ("entities", "says"),
    [
        ("", "no entities"),
        (entity("Ego") + entity("Ego"), "two entities are called 'Ego'"),
        (entity("Ego", PEDESTRIAN) + entity("Lead", PEDESTRIAN), "entity Ego is a pedestrian, which is not supported"),
        (
            entity("Ego") + entity("Lead", vehicle("tram")),
            "entity Lead is a tram, which is not supported: the simulator has car, van, truck, bus, motorbike, bicy",
        ),
        (entity("Ego") + entity("Cone", "<MiscObject/>"), "entity Cone is a MiscObject"),
        (entity("Ego") + entity("Lead", vehicle(length=-1)), "size_m.0: Input should be"),
        (entity("Ego") + entity("Lead", vehicle(length=500)), "size_m.0: Input should be"),
        (entity("Ego") + entity("Lead", '<Vehicle vehicleCategory="car"/>'), "Vehicle has no BoundingBox"),
        (entity("Ego") + entity("Lead", REFERENCE.format("")), "no parameter 'catalog' is declared"),
        ("".join(entity(f"e{i}") for i in range(200)), "more than 100 entities"),
    ],
)
def test_entities_that_cannot_be_simulated(entities: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says) as error:
        Parts(entities=entities).load(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('entryName="small"', 'entryName="big"'), "no entry 'big' in catalog 'cars'"),
        (('catalogName="$catalog"', 'catalogName="vans"'), "no catalog 'vans' in the folders of CatalogLocations"),
        (('path="catalogs"', 'path="nowhere"'), "the catalogs in nowhere cannot be read: No such file"),
    ],
)
def test_a_missing_catalog(change: tuple[str, str], says: str, tmp_path: Path) -> None:
    parts = with_catalog(tmp_path)
    parts.entities, parts.catalogs = parts.entities.replace(*change), parts.catalogs.replace(*change)
    with pytest.raises(ScenarioError, match=says):
        parts.load(tmp_path)


def test_an_entity_without_a_position_is_left_out_with_a_note(tmp_path: Path) -> None:
    made = Parts(init=init("Ego", on_lane(-1, 100.0), "20")).load(tmp_path)
    assert made.actors == ()
    assert made.notes == ("Lead is left out: it has no position at the start.",)
