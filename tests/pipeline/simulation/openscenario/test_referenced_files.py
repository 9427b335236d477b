"""A file that a scenario refers to belongs to it: if it is edited, the source is another."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.sources.fingerprint import fingerprint
from tests.pipeline.simulation.openscenario.files import Parts

DISTRIBUTION = (
    '<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="drive.xosc"/>'
    "<Deterministic/></ParameterValueDistribution></OpenSCENARIO>"
)


@pytest.mark.parametrize("edited", ["variants.xosc", "drive.xosc", "road.xodr", "catalogs/cars.xosc"])
def test_every_file_counts(edited: str, tmp_path: Path) -> None:
    Parts(catalogs='<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>').write(tmp_path)
    (tmp_path / "variants.xosc").write_text(DISTRIBUTION)
    (tmp_path / "catalogs").mkdir()
    (tmp_path / "catalogs" / "cars.xosc").write_text("<OpenSCENARIO/>")
    uri = f"{tmp_path / 'variants.xosc'}?variant=1"
    before = fingerprint(uri)
    assert fingerprint(uri) == before
    (tmp_path / edited).write_text((tmp_path / edited).read_text() + " ")
    assert fingerprint(uri) != before


@pytest.mark.parametrize("content", ["", "<a/>", DISTRIBUTION.replace("drive.xosc", "a.xosc"), DISTRIBUTION])
def test_whatever_is_in_it_there_is_a_fingerprint(content: str, tmp_path: Path) -> None:
    (tmp_path / "a.xosc").write_text(content)
    assert len(fingerprint(f"sim:{tmp_path / 'a.xosc'}")) == 16
