"""The 3D view as a browser sees it: what arrives, what stays, what goes, and what sliders do."""

from __future__ import annotations

import dataclasses
import queue
import socket
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.core.shared_view_state import FrameInView, HeldCuboid, LabelInView, LabelsInView, PageView
from app.views.viser.gui import ParamsGui
from app.views.viser.view import POSES, ViserView
from pipeline.common.geometry import Cuboid
from pipeline.params import Params, with_changes
from pipeline.types import Cipv, Frame, Layers, Result
from pipeline.types.lane import EgoLane, LaneLine

Ticks = list[tuple[Frame, Result]]
Changes = queue.Queue[tuple[str, Any]]
PARTS = (
    *("/points", "/cuboids", "/footprints", "/rays", "/velocities", "/cipv", "/path/ribbon", "/path/lines", "/grid"),
    *("/ego", "/camera/image", "/camera/edges"),
)


@pytest.fixture
def changes() -> Changes:
    return queue.Queue()


@pytest.fixture
def view(changes: Changes) -> Iterator[ViserView]:
    view = ViserView(Params(), lambda name, value: changes.put((name, value)))
    yield view
    view.close()


def test_who_joins_late_gets_the_present_image(view: ViserView, frame: Frame, result: Result, open_scene: Any) -> None:
    view.show(frame, result)
    client = open_scene(view.port)
    client.read_present_state()
    assert {name: True for name in PARTS}.items() <= client.nodes().items()
    client.read_names("#7 car 19.9 m")
    theme = next(each for each in client.messages if each["type"] == "ThemeConfigurationMessage")
    assert (theme["dark_mode"], theme["show_share_button"]) == (True, False)


def test_camera_starts_behind_and_above_the_ego_looking_forward(view: ViserView, open_scene: Any) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    of_type = {each["type"]: each for each in client.messages if each.get("initial")}
    x, _, z = of_type["SetCameraPositionMessage"]["position"]
    ahead, _, _ = of_type["SetCameraLookAtMessage"]["look_at"]
    assert x < 0 < z
    assert ahead > 0


def test_what_vanishes_is_hidden(view: ViserView, frame: Frame, result: Result, open_scene: Any) -> None:
    view.show(frame, result)
    nothing = Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32))
    view.show(
        dataclasses.replace(frame, sweep=None, image=None),
        dataclasses.replace(result, objects=(), cipv=None, layers=nothing),
    )
    client = open_scene(view.port)
    client.read_present_state()
    shown = {name for name, visible in client.nodes().items() if visible}
    assert shown & set(PARTS) == {"/path/ribbon", "/path/lines", "/grid", "/ego"}
    assert client.texts() == []


def test_labels_and_the_ego_car_follow_the_newest_frame(
    view: ViserView, frame: Frame, result: Result, open_scene: Any
) -> None:
    view.show(frame, result)
    assert result.layers.ground is not None
    planes = result.layers.ground.planes - [0.0, 0.0, 0.0, 0.5]
    layers = dataclasses.replace(result.layers, ground=dataclasses.replace(result.layers.ground, planes=planes))
    nearer = dataclasses.replace(result.objects[0], distance_m=11.0)
    view.show(frame, dataclasses.replace(result, objects=(nearer, *result.objects[1:]), layers=layers))
    client = open_scene(view.port)
    client.read_present_state()
    client.read_names("#7 car 11.0 m")
    placed = [each for each in client.messages if each["type"] == "SetPositionMessage" and each["name"] == "/ego"]
    assert placed[-1]["position"][2] == pytest.approx(-1.2 + 0.5 + 1.5 / 2, abs=1e-3), "on this frame's ground"


def test_each_page_sees_its_own_selection_and_labels(frame: Frame, result: Result, open_scene: Any) -> None:
    label = LabelInView(3, Cuboid((20.0, 1.0, 0.8), (4.0, 2.0, 1.5), 0.4), "lead #3 car, accepted", "cipv", True)
    views = {"a1": PageView(selected=8, labels=LabelsInView((label,), True))}
    view = ViserView(Params(), view_of=lambda page: views.get(page, PageView()))
    try:
        view.show(frame, result)
        mine, other = open_scene(view.port, page="a1"), open_scene(view.port, page="b2")
        other.read_present_state()
        mine.look()
        mine.read_names("#8 obstacle 15.9 m", "lead #3 car, accepted")
        other.read_names("#7 car 19.9 m")
        assert mine.nodes()["/selection"]
        assert mine.nodes()["/own/cuboids"]
        assert mine.owned("/cuboids"), "the pipeline's objects are covered, for this page"
        assert not other.owned("/cuboids")
        owned = {name for name in other.nodes() if name.startswith(("/own/", "/selection"))}
        assert owned == {"/own/names", "/own/names/0"}, "its name tags alone"
        views["a1"] = PageView()
        view.look()
        mine.read_names("#7 car 19.9 m")
        assert not mine.nodes()["/selection"]
        assert not mine.owned("/cuboids")
    finally:
        view.close()


def test_name_tags_that_would_cover_each_other_are_shown_once_the_camera_has_moved(
    frame: Frame, result: Result, open_scene: Any
) -> None:
    near, far = (
        LabelInView(number, Cuboid((x, 0.0, 0.8), (4.0, 2.0, 1.5), 0.0), f"#{number} car", "fused", True)
        for number, x in ((3, 20.0), (4, 24.0))
    )
    views = {"a1": PageView(labels=LabelsInView((near, far), True))}
    view = ViserView(Params(), view_of=lambda page: views[page])
    try:
        view.show(frame, result)
        client = open_scene(view.port, page="a1")
        client.look(-60.0)
        client.read_names("#3 car")
        client.look(8.0, 3.0)
        client.read_names("#3 car", "#4 car")
    finally:
        view.close()


def test_of_objects_whose_name_tags_would_cover_each_other_the_lead_has_the_room_unless_another_is_selected(
    frame: Frame, result: Result, open_scene: Any
) -> None:
    lead = result.objects[0]
    nearer = dataclasses.replace(lead, id=11, distance_m=16.0, bev=tuple((x - 4.0, y) for x, y in lead.bev or ()))
    views = {"a1": PageView()}
    view = ViserView(Params(), view_of=lambda page: views[page])
    try:
        view.show(frame, dataclasses.replace(result, objects=(nearer, lead)))
        client = open_scene(view.port, page="a1")
        client.look(-60.0)
        client.read_names("#7 car 19.9 m")
        views["a1"] = PageView(selected=11)
        view.look()
        client.read_names("#11 car 16.0 m")
    finally:
        view.close()


def test_a_page_with_its_own_playhead_sees_its_own_frame_and_the_others_the_shared_one(
    frame: Frame, result: Result, open_scene: Any
) -> None:
    nearer = dataclasses.replace(result.objects[0], distance_m=11.0)
    mine_only = FrameInView(
        dataclasses.replace(frame, image=None), dataclasses.replace(result, objects=(nearer, *result.objects[1:]))
    )
    views = {"a1": PageView(frame=mine_only)}
    view = ViserView(Params(), view_of=lambda page: views.get(page, PageView()))
    try:
        view.show(frame, result)
        mine, other = open_scene(view.port, page="a1"), open_scene(view.port, page="b2")
        other.read_present_state()
        mine.look()
        mine.read_until(lambda each: each.get("name") == "/ego" and each.get("owner"))
        mine.read_names("#7 car 11.0 m")
        assert mine.owned("/points")
        assert mine.owned("/camera/image")
        assert not mine.nodes()["/camera/image"], "its frame has no image, and the shared one is covered"
        other.read_names("#7 car 19.9 m")
        assert {each["name"] for each in other.messages if each.get("owner")} <= {"/own", "/own/names", "/own/names/0"}

        views["a1"] = PageView(frame=mine_only, labels=LabelsInView((), True))
        view.look()
        mine.read_until(lambda each: each["type"] == "SetSceneNodeVisibilityMessage" and each["name"] == "/cuboids")
        assert not mine.nodes()["/cuboids"], "its labels are alone"
        assert mine.owned("/cuboids"), "and the shared frame's objects stay covered"

        views["a1"] = PageView()
        view.look()
        mine.read_until(lambda each: each["type"] == "RemoveSceneNodeMessage" and each["name"] == "/cuboids")
        parts = (*PARTS, "/next_cipv", "/path/lanes")
        assert not [name for name in parts if mine.owned(name)], "the shared frame again"
    finally:
        view.close()


def test_the_camera_goes_to_a_label_when_it_is_selected_and_then_stays(
    frame: Frame, result: Result, open_scene: Any
) -> None:
    car = Cuboid((20.0, 10.0, 0.8), (4.0, 2.0, 1.5), 0.4)
    views = {"a1": PageView(held=HeldCuboid(None, 3, 0, car))}
    view = ViserView(Params(), view_of=lambda page: views[page])
    try:
        view.show(frame, result)
        client = open_scene(view.port, page="a1")
        client.look()
        went = client.read_until(lambda each: each["type"] == "SetCameraLookAtMessage" and not each.get("initial"))
        assert went["look_at"] == pytest.approx(car.center)
        client.messages.clear()
        views["a1"] = PageView(held=HeldCuboid(None, 3, 1, car._replace(center=(30.0, 10.0, 0.8))))
        view.look()
        client.read_until(lambda each: each.get("name") == "/held/edges")
        assert not [each for each in client.messages if each["type"] == "SetCameraLookAtMessage"]
    finally:
        view.close()


def test_lanes_and_the_next_vehicle_are_drawn_where_there_are_any(
    view: ViserView, frame: Frame, result: Result, open_scene: Any
) -> None:
    line = LaneLine("left", np.array([1.8, 0.0, 0.0, 0.0]), np.eye(4), 3.0, 30.0, 1.0, 0.0)
    layers = dataclasses.replace(result.layers, lanes=EgoLane(line, None, "classical", 0.0, 0.0, None, np.zeros(3)))
    following = Cipv(8, 15.9, None, None, "next")
    view.show(frame, dataclasses.replace(result, layers=layers, next_cipv=following))
    client = open_scene(view.port)
    client.read_present_state()
    assert client.nodes()["/path/lanes"]
    assert client.nodes()["/next_cipv"]
    view.show(frame, result)
    late = open_scene(view.port)
    late.read_present_state()
    assert not late.nodes()["/path/lanes"]
    assert not late.nodes()["/next_cipv"]


@pytest.mark.parametrize("name", POSES)
def test_a_button_takes_the_camera_of_whoever_pressed_it_there(view: ViserView, open_scene: Any, name: str) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    group = next(each for each in client.messages if each["type"] == "GuiButtonGroupMessage")
    client.move(group["uuid"], name)
    moved = client.read_until(lambda each: each["type"] == "SetCameraPositionMessage" and not each.get("initial"))
    assert moved["position"] == pytest.approx(POSES[name].eye)


def test_a_thousand_objects_later_a_late_browser_gets_no_more_than_at_first(
    view: ViserView, frame: Frame, result: Result, open_scene: Any
) -> None:
    counts = []
    for ids in (range(0, 2), range(2, 60)):
        for tick in ids:
            objects = tuple(dataclasses.replace(each, id=each.id + 20 * tick) for each in result.objects)
            lead = dataclasses.replace(result.cipv, id=7 + 20 * tick)  # type: ignore[type-var]
            view.show(frame, dataclasses.replace(result, objects=objects, cipv=lead))
        client = open_scene(view.port)
        client.read_present_state()
        counts.append((len(client.messages), sorted(client.nodes())))
    assert counts[0] == counts[1]


def test_a_frame_shown_while_somebody_looks_arrives(view: ViserView, frames: Ticks, open_scene: Any) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    view.show(*frames[0])
    client.read_until(lambda each: each.get("name") == "/points" and each["type"] == "PointCloudMessage")


def test_a_slider_that_a_person_moves_is_heard_of_once(view: ViserView, changes: Changes, open_scene: Any) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    (slider,) = client.inputs("Z weight")
    client.move(slider["uuid"], 0.25)
    assert changes.get(timeout=180) == ("cluster.z_weight", 0.25)
    assert changes.empty()


def test_parameters_set_from_outside_reach_browsers_and_nobody_is_told(
    view: ViserView, changes: Changes, open_scene: Any
) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    (slider,) = client.inputs("Z weight")
    view.set_params(with_changes(Params(), {"cluster.z_weight": 0.9, "cluster.front_only": False}))
    update = client.read_until(lambda each: each["type"] == "GuiUpdateMessage" and each["uuid"] == slider["uuid"])
    assert update["updates"] == {"value": 0.9}
    client.move(slider["uuid"], 0.3)
    assert changes.get(timeout=180) == ("cluster.z_weight", 0.3), "only the person's own move is told"


def test_a_slider_just_moved_is_not_put_back_by_parameters_that_say_nothing_new(view: ViserView) -> None:
    slider = view._params._inputs["cluster.z_weight"]
    slider.value = 0.25  # as viser does when a person moves it, before anybody has heard of it
    view.set_params(with_changes(Params(), {"cluster.front_only": False}))
    assert slider.value == 0.25


def test_a_refused_value_is_put_back(view: ViserView, changes: Changes, open_scene: Any) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    (slider,) = client.inputs("Z weight")
    client.move(slider["uuid"], 0.25)
    changes.get(timeout=180)
    view.set_params(Params())
    client.read_until(
        lambda each: each.get("uuid") == slider["uuid"] and each.get("updates") == {"value": Params().cluster.z_weight}
    )


def test_a_parameter_that_may_be_null_has_a_switch(view: ViserView, changes: Changes, open_scene: Any) -> None:
    client = open_scene(view.port)
    client.read_present_state()
    (switch,) = client.inputs("H res (°/px) auto")
    (slider,) = client.inputs("H res (°/px)")
    assert (switch["value"], slider["props"]["disabled"]) == (True, True)
    client.move(slider["uuid"], 0.05)
    assert changes.get(timeout=180) == ("alignment.h_res_deg", 0.05)
    client.move(switch["uuid"], True)
    client.move(switch["uuid"], False)
    client.read_until(lambda each: each.get("uuid") == slider["uuid"] and each.get("updates") == {"disabled": False})


def test_every_parameter_has_an_input(view: ViserView) -> None:
    declared = {f"{section}.{key}" for section, values in Params().model_dump().items() for key in values}
    gui: ParamsGui = view._params
    assert set(gui.names) == declared


def test_display_choices_redraw_the_frame_that_is_shown(
    view: ViserView, frame: Frame, result: Result, open_scene: Any
) -> None:
    view.show(frame, result)
    client = open_scene(view.port)
    client.read_present_state()
    client.move(client.inputs("Point size (m)")[0]["uuid"], 0.3)
    cloud = client.read_until(lambda each: each.get("name") == "/points" and "props" in each)
    assert cloud["props"]["point_size"] == 0.3
    client.move(client.inputs("Labels")[0]["uuid"], "all")
    client.read_names("#7 car 19.9 m", "#8 obstacle 15.9 m", "#9 truck 45.0 m carried")
    client.move(client.inputs("Camera image")[0]["uuid"], False)
    client.read_until(lambda each: each.get("name") == "/camera/image" and each.get("visible") is False)


def test_it_listens_on_loopback_only_and_a_taken_port_becomes_another(view: ViserView) -> None:
    assert view._server.get_host() == "127.0.0.1"
    second = ViserView(Params(), port=view.port)
    try:
        assert second.port != view.port
    finally:
        second.close()


def test_closing_frees_the_port(capsys: pytest.CaptureFixture[str]) -> None:
    view = ViserView(Params())
    port = view.port
    view.close()
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0
    assert capsys.readouterr().out == "", "the address that people open is printed by the web server alone"
