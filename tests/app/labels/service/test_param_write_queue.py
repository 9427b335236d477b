"""Parameters that are settled become steps that can be undone; what is only tried does not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from app.core.control import Control, Wish
from pipeline.params import Params, ParamsError


class Steps:
    """Receives the steps as the log does."""

    def __init__(self) -> None:
        self.heard: list[tuple[dict[str, Any], str, bool]] = []

    def __call__(self, changes: Mapping[str, tuple[Any, Any]], person: str, *, merges: bool) -> None:
        self.heard.append((dict(changes), person, merges))


@pytest.fixture
def steps() -> Steps:
    return Steps()


@pytest.fixture
def control(steps: Steps) -> Control:
    control = Control(Wish(Params()))
    control.on_settle = steps
    return control


def hits(control: Control) -> int:
    return control.peek().params.cipv.confirm_hits


def test_what_is_settled_is_told_once_with_what_it_was(control: Control, steps: Steps) -> None:
    for value, final in ((5, False), (7, False), (8, True), (8, True)):
        control.change_params({"cipv.confirm_hits": value}, final=final, person="Ada")
    assert steps.heard == [({"cipv.confirm_hits": (3, 8)}, "Ada", False)]
    control.change_params({"cipv.confirm_hits": 9}, merge=True)
    assert steps.heard[-1] == ({"cipv.confirm_hits": (8, 9)}, "", True)


def test_a_preset_is_a_step_with_its_name(control: Control, steps: Steps) -> None:
    control.set_params(Params(), "paper")
    assert steps.heard == [({"preset": ("default", "paper")}, "", False)]
    control.restore({"preset": "default"})
    assert control.peek().preset == "default"


def test_a_restored_step_is_none_of_its_own_and_ends_what_is_tried(control: Control, steps: Steps) -> None:
    control.change_params({"cipv.confirm_hits": 5})
    control.change_params({"cipv.confirm_hits": 9}, final=False)
    before = control.peek().params_revision
    control.restore({"cluster.z_weight": 0.3})
    assert (hits(control), control.peek().params.cluster.z_weight) == (5, 0.3)
    assert (control.peek().settled, control.peek().params_revision, len(steps.heard)) == (True, before + 1, 1)
    control.change_params({"cipv.confirm_hits": 6})
    assert steps.heard[-1][0] == {"cipv.confirm_hits": (5, 6)}


def test_what_is_tried_can_be_given_up(control: Control, steps: Steps) -> None:
    assert not control.forget_tried()
    control.change_params({"cipv.confirm_hits": 9}, final=False)
    assert control.forget_tried()
    assert (hits(control), steps.heard, control.peek().settled) == (3, [], True)


def test_what_is_no_parameter_any_more_is_not_restored(control: Control) -> None:
    with pytest.raises(ParamsError, match="gone"):
        control.restore({"gone.name": 1})
    assert control.peek().params == Params()
