"""The newest request wins, and each is served once."""

from __future__ import annotations

import threading

from app.core.control import Control, Wish
from pipeline.params import Params, with_changes


def control() -> Control:
    made = Control(Wish(Params()))
    made.change(playing=False)
    made.take(0)
    return made


def test_of_three_seeks_only_the_last_is_served():
    wishes = control()
    for index in (3, 5, 7):
        wishes.seek(index)
    assert wishes.take(0).target == 7
    assert wishes.take(0).target is None


def test_steps_add_up_and_pause():
    wishes = control()
    wishes.change(playing=True)
    for _ in range(3):
        wishes.step(1)
    taken = wishes.take(0)
    assert (taken.steps, taken.playing) == (3, False)
    assert wishes.take(0).steps == 0


def test_a_seek_forgets_steps_not_yet_made():
    wishes = control()
    wishes.step(2)
    wishes.seek(9)
    taken = wishes.take(0)
    assert (taken.target, taken.steps) == (9, 0)


def test_playing_speed_and_loop_stand_until_changed():
    wishes = control()
    wishes.change(playing=True, speed=2.0, loop=False)
    for _ in range(2):
        taken = wishes.take(0)
        assert (taken.playing, taken.speed, taken.loop) == (True, 2.0, False)


def test_each_set_of_parameters_gets_a_newer_revision():
    wishes = control()
    first, second = wishes.set_params(Params()), wishes.set_params(Params(), "paper")
    assert second == first + 1
    assert wishes.peek().preset == "paper"


def test_a_waiting_worker_wakes_on_a_change():
    wishes = control()
    taken: list[Wish] = []
    worker = threading.Thread(target=lambda: taken.append(wishes.take(20.0)))
    worker.start()
    wishes.seek(4)
    worker.join(20.0)
    assert taken[0].target == 4


def test_a_seek_supersedes_but_a_parameter_does_not():
    wishes = control()
    wishes.set_params(Params())
    assert not wishes.superseded()
    wishes.seek(1)
    assert wishes.superseded()


def test_changes_of_many_callers_at_once_are_all_kept() -> None:
    control = Control(Wish(Params()))
    changes = [{"cluster.z_weight": 0.7}, {"path.half_width_m": 2.0}, {"fusion.min_iou": 0.2}, {"acc.kp": 1.0}]
    start = threading.Barrier(len(changes))

    def change(one: dict[str, float]) -> None:
        start.wait()
        control.change_params(one)

    threads = [threading.Thread(target=change, args=(one,)) for one in changes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = with_changes(Params(), {name: value for one in changes for name, value in one.items()})
    assert control.peek().params == expected
    assert control.peek().params_revision == len(changes)
