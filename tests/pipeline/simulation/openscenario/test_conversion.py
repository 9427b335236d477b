"""A whole file as a source: frames, truth, notes, a closed loop's start, and references between files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation import scenario
from pipeline.simulation.drive_as_scenario import to_yaml
from pipeline.simulation.scenario import ScenarioError
from pipeline.sources import SourceError, open_source
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    condition,
    event,
    init,
    lane,
    lane_action,
    on_lane,
    speed_action,
    story,
    xodr,
)

PARTS = Parts(
    stories=story(
        event("brake", speed_action("5", "linear", 3.0, "rate"), condition(at_time(1.0))),
        event("right", lane_action('<AbsoluteTargetLane value="-2"/>'), condition(at_time(2.0))),
    )
)


@pytest.mark.parametrize("scheme", ["", "sim:"])
def test_it_opens_as_a_source_with_sensors_and_truth(scheme: str, tmp_path: Path) -> None:
    source = open_source(f"{scheme}{PARTS.write(tmp_path)}")
    frame = source.frame(0)
    assert frame.image is not None
    assert frame.sweep is not None
    (truth,) = source.truth(0)
    assert (truth.label, truth.cuboid.center[0], truth.cuboid.size) == ("car", 48.0, (4.0, 2.0, 1.5))
    assert (len(source), source.title) == (100, "drive")


def test_a_folder_with_a_single_scenario_stands_for_it(tmp_path: Path) -> None:
    PARTS.write(tmp_path)
    assert len(open_source(str(tmp_path))) == 100


def test_options_of_a_bare_path(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="it has no variants"):
        open_source(f"{PARTS.write(tmp_path)}?variant=2")


def test_it_can_be_kept_as_an_ordinary_scenario(tmp_path: Path) -> None:
    made = PARTS.load(tmp_path)
    assert scenario.parse(to_yaml(made), "a.yaml") == made


def test_a_road_without_paint_has_no_lines_in_its_image(tmp_path: Path) -> None:
    """White pixels below the horizon and the posts, where the road is."""
    lanes = f"<left>{lane(1, mark='{}')}</left><right>{lane(-1, mark='{}')}{lane(-2, mark='{}')}</right>"
    white = []
    for mark in ("solid", "none"):
        PARTS.road = xodr(lanes=lanes.replace("{}", mark))
        image = open_source(str(PARTS.write(tmp_path))).frame(0).image
        assert image is not None
        road = image.bgr[image.bgr.shape[0] * 5 // 9 :]
        white.append(int(np.count_nonzero(road.min(axis=2) > 180)))
    assert white[0] > 500
    assert white[1] < 50


def test_positions_of_a_file_for_carla_are_left_handed(tmp_path: Path) -> None:
    parts = Parts(
        init=init("Ego", '<WorldPosition x="100" y="1.75" h="0"/>', "20")
        + init("Lead", '<WorldPosition x="150" y="${1.5+3.75}" h="0"/>', "20")
    )
    path = parts.write(tmp_path)
    path.write_text(path.read_text().replace("<FileHeader", '<FileHeader description="CARLA:Follow"'))
    made = scenario.load(str(path))
    assert [made.road.lane_offset_m(each.lane) + each.offset_m for each in (made.ego, *made.actors)] == [-1.75, -5.25]
    assert made.notes[0].startswith("World positions are read in CARLA's left-handed coordinates")


def test_a_file_of_version_0_9_says_so(tmp_path: Path) -> None:
    path = Parts(entities='<Object name="Ego"/>').write(tmp_path)
    with pytest.raises(ScenarioError, match=r"it is written for OpenSCENARIO 0\.9; versions 1\.0 to"):
        scenario.load(str(path))


def test_an_ego_vehicle_without_a_speed_is_said_to_stand(tmp_path: Path) -> None:
    parts = Parts(init=init("Ego", on_lane(-1, 100.0)) + init("Lead", on_lane(-1, 150.0), "20"))
    assert parts.load(tmp_path).notes == ("The ego vehicle stands throughout: the file gives it no speed.",)


def test_shoulders_reach_below_every_vehicle(tmp_path: Path) -> None:
    """A lane that begins later is not drawn, but a vehicle that changes onto it does not drive on grass."""
    wider = f"<right>{lane(-1)}{lane(-2)}</right>"
    parts = Parts(
        stories=story(event("right", lane_action('<AbsoluteTargetLane value="-2"/>'), condition(at_time(5.0)))),
        road=xodr(lanes=f'<right>{lane(-1)}</right></laneSection><laneSection s="180">{wider}'),
    )
    made = parts.load(tmp_path)
    assert made.road.edges_m() == ((-3.5, 0.0),)
    assert made.road.shoulder_m == pytest.approx(5.25 - 3.5 + 2.0)


@pytest.mark.parametrize("named", ["../xodr/road.xodr", "a\\\\road.xodr", "C:\\\\maps\\\\road", "road"])
def test_files_that_were_copied_into_one_folder(named: str, tmp_path: Path) -> None:
    path = Parts().write(tmp_path)
    path.write_text(path.read_text().replace("road.xodr", named.replace("\\\\", "\\")))
    assert len(open_source(str(path))) == 100


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("road.xodr", "missing.xodr"), "missing.xodr: cannot be read: No such file"),
        (("road.xodr", "."), "cannot be read: Is a directory"),
        (("road.xodr", "drive.xosc"), "drive.xosc: not OpenDRIVE: its outermost element is OpenSCENARIO"),
        (("<RoadNetwork>", "<Network>"), "drive.xosc, line 1: not XML: mismatched tag"),
        (('<LogicFile filepath="road.xodr"/>', ""), "RoadNetwork has no LogicFile"),
        (("<Init><Actions>", "<Init><Others>"), "not XML"),
        (('entityRef="Ego"', 'entityRef="Nobody"'), "no entity 'Nobody'"),
        (("TeleportAction", "Teleported"), "the ego vehicle Ego has no position in Init"),
    ],
)
def test_what_is_missing_is_named(change: tuple[str, str], says: str, tmp_path: Path) -> None:
    path = Parts().write(tmp_path)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(ScenarioError, match=says) as error:
        scenario.load(str(path))
    assert "\n" not in str(error.value)
