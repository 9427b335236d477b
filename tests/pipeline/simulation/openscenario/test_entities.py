"""Entities: bodies inline and from catalogs, which one is the ego vehicle, and those that are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import Parts, declared, entity, init, on_lane, vehicle

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


@pytest.mark.parametrize("name", ["Ego", "ego", "EGO", "Hero", "hero"])
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


@pytest.mark.parametrize(
    ("entities", "says"),
    [
        (entity("A") + entity("B"), "which entity is the ego vehicle.* there are A, B"),
        (entity("Ego") + entity("hero"), "which entity is the ego vehicle"),
        ("", "there are none"),
        (entity("Ego") + entity("Ego"), "two entities are called 'Ego'"),
        (entity("Ego") + entity("Child", PEDESTRIAN), "entity Child is a Pedestrian, which is not supported"),
        (entity("Ego") + entity("Lead", vehicle("bicycle")), "entity Lead is a bicycle, which is not supported"),
        (entity("Ego") + entity("Lead", vehicle("tram")), "the simulator has car, van, truck, bus, motorbike"),
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
