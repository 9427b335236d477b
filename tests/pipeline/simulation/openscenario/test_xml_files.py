"""Files of unknown origin: whatever is in them, the answer is one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.files.user_files import FOLDERS_VARIABLE
from pipeline.simulation import scenario
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, read_xml
from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import Parts

LAUGHS = (
    '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'
    "<OpenSCENARIO>&c;</OpenSCENARIO>"
)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        pytest.param(b"", "not XML: no element found", id="empty"),
        pytest.param(b"<?xml", "not XML: ", id="cut in the declaration"),
        pytest.param(b"<OpenSCENARIO><a>", "not XML: no element found", id="cut off"),
        pytest.param(b"<OpenSCENARIO></a>", "not XML: mismatched tag", id="mismatched"),
        pytest.param(b"\xff\xfe\0\0", "not XML: ", id="bytes"),
        pytest.param(b'<?xml version="1.0" encoding="klingon"?><a/>', "not XML: ", id="encoding"),
        pytest.param(LAUGHS.encode(), "a document type is not allowed", id="entities"),
        pytest.param(LAUGHS.encode("utf-16"), "a document type is not allowed", id="entities in UTF-16"),
        pytest.param(
            b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>', "a document type is not allowed", id="external entity"
        ),
        pytest.param(b"<a>" * 100 + b"</a>" * 100, "more than 60 inside one another", id="deep"),
        pytest.param(b"<a>" + b"<b/>" * 300_001 + b"</a>", "more than 300000 elements", id="many"),
        pytest.param(b"<OpenDRIVE/>", "not OpenSCENARIO: its outermost element is OpenDRIVE", id="another"),
        pytest.param(b"<OpenSCENARIO/>", "no Storyboard", id="nothing in it"),
    ],
)
def test_a_damaged_or_hostile_file_is_refused_in_one_line(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "a.xosc"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=says) as error:
        scenario.load(str(path))
    assert str(error.value).startswith("a.xosc")
    assert "\n" not in str(error.value)


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.xosc"
    with path.open("wb") as file:
        file.truncate(17 << 20)
    with pytest.raises(OpenScenarioError, match="larger than 16 MiB"):
        read_xml(path, "OpenSCENARIO")


@pytest.mark.parametrize("cut", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_a_scenario_that_is_cut_off_anywhere_names_the_line(cut: float, tmp_path: Path) -> None:
    path = Parts().write(tmp_path)
    text = path.read_text()
    path.write_text(text[: int(len(text) * cut)])
    with pytest.raises(ScenarioError, match=r"drive.xosc, line 1: not XML: "):
        scenario.load(str(path))


def test_files_outside_the_allowed_folders_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "allowed").mkdir()
    path = Parts().write(tmp_path / "allowed")
    monkeypatch.setenv(FOLDERS_VARIABLE, str(tmp_path / "allowed"))
    assert scenario.load(str(path)).actors
    (tmp_path / "secret.xodr").write_text("<secret/>")
    path.write_text(path.read_text().replace("road.xodr", "../secret.xodr"))
    with pytest.raises(ScenarioError, match="outside the allowed folders"):
        scenario.load(str(path))
