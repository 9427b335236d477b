"""The 3D view follows the engine while somebody looks, and its sliders reach the engine."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from typing import Any

import pytest

from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.views.lazy_scene import LateScene
from app.views.scene_feed import SceneFeed
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener

WAIT_S = 180.0


@pytest.fixture
def engine() -> Iterator[Engine]:
    recording = Recording()
    started = Engine(opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri)
    started.start()
    started.wait_for(lambda shown: shown.processed is not None, WAIT_S)
    yield started
    started.stop()


def test_nothing_is_drawn_while_nobody_looks(engine: Engine) -> None:
    with SceneFeed(engine) as feed:
        engine.control.seek(1)
        engine.wait_for(lambda shown: shown.index == 1, WAIT_S)
    assert feed.drawn == 0


def test_who_comes_to_look_sees_the_present_frame_and_the_ones_after(engine: Engine, open_scene: Any) -> None:
    with SceneFeed(engine) as feed:
        client = open_scene(feed.port)
        client.look()
        client.read_until(_is_cloud)
        engine.control.seek(1)
        client.read_until(_is_cloud)
    assert feed.drawn >= 2


def test_a_page_that_hides_its_3d_view_costs_nothing_until_it_shows_it_again(engine: Engine, open_scene: Any) -> None:
    looks, page = SharedViewState(), object()
    with SceneFeed(engine, looks) as feed:
        client = open_scene(feed.port)
        client.look()
        client.read_until(_is_cloud)
        looks.hide(page, True)
        for index in range(1, 4):
            engine.control.seek(index)
            engine.wait_for(lambda shown, index=index: shown.index == index, WAIT_S)
        looks.hide(page, False)
        client.read_until(_is_cloud)
    assert feed.drawn == 2, "the first one and the last one"


def test_what_is_clicked_in_a_pages_3d_view_is_selected_at_that_page(engine: Engine, open_scene: Any) -> None:
    tick = engine.snapshot.processed
    assert tick is not None
    target = next(each for each in tick.result.objects if each.cuboid is not None)
    assert target.cuboid is not None
    x, y, _ = target.cuboid.center
    picked: queue.Queue[tuple[object, int | None]] = queue.Queue()
    looks, page, other = SharedViewState(), object(), object()
    looks.name(page, "a1")
    looks.name(other, "b2")
    looks.on_pick(lambda *what: picked.put(what))
    with SceneFeed(engine, looks) as feed:
        client = open_scene(feed.port, page="a1")
        client.look()
        client.read_until(_is_cloud)
        client.click((x, y, 50.0), (0.0, 0.0, -1.0))
        assert picked.get(timeout=WAIT_S) == (page, target.id)
        client.read_until(lambda message: message.get("name") == "/selection")
        client.click((x, y, 50.0), (0.0, 0.0, 1.0))
        assert picked.get(timeout=WAIT_S) == (page, None), "beside everything"
    assert (looks.view_of(page).selected, looks.view_of(other).selected) == (None, None)


def test_what_is_selected_at_a_page_is_marked_in_the_3d_view(engine: Engine, open_scene: Any) -> None:
    tick = engine.snapshot.processed
    assert tick is not None
    looks, page = SharedViewState(), object()
    looks.name(page, "a1")
    with SceneFeed(engine, looks) as feed:
        client = open_scene(feed.port, page="a1")
        client.look()
        client.read_until(_is_cloud)
        looks.select(page, tick.result.objects[0].id)
        client.read_until(lambda message: message.get("name") == "/selection")


def test_a_slider_of_the_3d_view_reaches_the_engine(engine: Engine, open_scene: Any) -> None:
    with SceneFeed(engine) as feed:
        client = open_scene(feed.port)
        client.read_present_state()
        slider = client.inputs("Half width (m)")[0]
        client.move(slider["uuid"], 2.5)
        engine.wait_for(lambda shown: shown.params.path.half_width_m == 2.5, WAIT_S)


def _is_cloud(message: dict[str, Any]) -> bool:
    """Whether the message creates or changes a cloud."""
    return str(message.get("name", "")).startswith("/points")


def test_it_is_started_when_somebody_first_asks_where_it_is(engine: Engine, open_scene: Any) -> None:
    with LateScene(engine, SharedViewState()) as late:
        port = late.port()
        assert late.port() == port
        client = open_scene(port)
        client.look()
        client.read_until(_is_cloud)
    assert late.port() is None
