"""What runs are made from, as users are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.fleet.pack_index import packs_of
from app.fleet.runs import about_run, differences, latest_run, make_latest, set_aside, summary
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.params import Params, with_changes
from tests.app.fleet.fleets import begun, plan_of


@pytest.fixture
def runs(fleet: Path, tmp_path: Path) -> tuple[Store, str, str]:
    """A folder with two planned runs, and their names: usual ones, and those of a LiDAR alone with other parameters."""
    usual = begun(plan_of(fleet), tmp_path)
    changed = with_changes(Params(), {"cluster.tolerance_m": 0.7, "cluster.min_points": 6})
    other = begun(plan_of(fleet, params=changed, sensors="lidar"), tmp_path)
    return usual.store, usual.key.name, other.key.name


def test_a_run_is_described_by_what_is_not_usual(runs: tuple[Store, str, str]):
    store, usual, other = runs
    assert summary(about_run(store, usual)) == "default parameters"
    said = summary(about_run(store, other)).split(", ")
    assert sorted(said) == ["cluster.min_points=6", "cluster.tolerance_m=0.7", "lidar only"]
    assert "64 rings" in summary(about_run(store, usual) | {"rings": 64})


def test_differences_of_two_runs(runs: tuple[Store, str, str]):
    usual, other = (about_run(runs[0], name) for name in runs[1:])
    assert differences(usual, usual) == []
    assert set(differences(usual, other)) == {
        "sensors both → lidar",
        f"cluster.tolerance_m {Params().cluster.tolerance_m} → 0.7",
        f"cluster.min_points {Params().cluster.min_points} → 6",
    }
    assert differences(usual, usual | {"code": "other", "networks": "other"}) == ["other code", "other networks"]
    assert differences(usual, usual | {"new.parameter": 3}) == ["new.parameter – → 3"]


def test_the_latest_run_can_be_another_one(runs: tuple[Store, str, str]):
    store, usual, other = runs
    assert latest_run(store) == other
    make_latest(store, usual)
    assert latest_run(store) == usual


def test_an_unknown_run_is_refused_and_the_known_ones_are_named(runs: tuple[Store, str, str]):
    store, usual, other = runs
    with pytest.raises(BadInput) as refused:
        about_run(store, "typo")
    assert usual in str(refused.value)
    assert other in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"run": 5}', b"[" * 100_000, b"\xff"])
def test_a_damaged_file_is_named_in_one_line(tmp_path: Path, content: bytes):
    store = Store(str(tmp_path))
    for name, read in {
        "latest.json": lambda: latest_run(store),
        "runs/a.json": lambda: about_run(store, "a"),
        "packed/run=a.json": lambda: packs_of(store, "a"),
        "aside/run=a/b.json": lambda: set_aside(store, "a"),
    }.items():
        if content in (b"[]", b"{}", b'{"run": 5}') and name in ("runs/a.json", "packed/run=a.json"):
            continue  # nothing is said, or what is said is ignored
        store.write(name, content)
        with pytest.raises(BadInput, match=f"{name}: damaged: ") as caught:
            read()
        assert "\n" not in str(caught.value)
