"""Spaces of parameters, the front, and a sweep over two drives."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.cli import main
from app.commands.fleet.sweep import ParameterSweep
from app.fleet.runs import latest_run
from app.fleet.store import Store
from app.fleet.sweep import Axis, Tried, best_of, fixed, front, grid, latin, parse_axis, points_of, searching
from pipeline.common.errors import BadInput
from pipeline.params import Params, from_yaml
from tests.app.fleet.fleets import begun, plan_of


def test_a_grid_has_every_combination():
    axes = [parse_axis("cluster.tolerance_m=0.6:1.2:3"), parse_axis("fusion.assignment=greedy,hungarian")]
    points = grid(axes)
    assert len(points) == 6
    assert points[0] == {"cluster.tolerance_m": 0.6, "fusion.assignment": "greedy"}
    assert {point["cluster.tolerance_m"] for point in points} == {0.6, 0.9, 1.2}


def test_a_latin_hypercube_spreads_each_parameter_evenly():
    axes = [parse_axis("a.x=0:10:5"), parse_axis("a.y=1,2")]
    points = latin(axes, 20)
    assert points == latin(axes, 20)
    assert np.histogram([point["a.x"] for point in points], bins=20, range=(0, 10))[0].tolist() == [1] * 20
    assert [sum(point["a.y"] == value for point in points) for value in (1, 2)] == [10, 10]


def test_ranges_of_whole_parameters_are_whole_numbers():
    axis = parse_axis("a.x=2:5:3").of_type(3)
    assert axis.values == (2, 4, 5)
    shares = [point["a.x"] for point in latin([axis], 40)]
    assert {value: shares.count(value) for value in (2, 3, 4, 5)} == dict.fromkeys((2, 3, 4, 5), 10)
    assert all(isinstance(value, int) for value in shares)
    assert parse_axis("a.x=2:5:3").of_type(3.0).values == (2.0, 3.5, 5.0)


def tried_all(axes: list[Axis], count: int) -> list[Tried]:
    """A search in which both scores are lowest near x = 0.7, y = b and n = 3; the second set has no scores."""
    propose, tried = searching(axes, count), list[Tried]()
    while (found := propose(tried)) is not None:
        off = abs(found["x"] - 0.7) + (found["y"] != "b") + abs(found["n"] - 3)
        tried.append(Tried(f"{len(tried)}", found, off, 2.0 * off if len(tried) != 1 else None))
    return tried


def test_a_search_comes_nearer_to_the_best_and_is_the_same_again():
    axes = [parse_axis("x=0:1:2"), parse_axis("y=a,b,c"), parse_axis("n=0:9:2").of_type(1)]
    tried = tried_all(axes, 60)
    assert tried == tried_all(axes, 60)
    missed = np.array([each.missed for each in tried])
    assert len(missed) == 60
    assert missed.min() < 0.1
    assert np.median(missed[-20:]) < 0.5 * np.median(missed[:10])
    assert {type(each.changes["n"]) for each in tried} == {int}


def test_fixed_sets_come_in_order():
    propose = fixed([{"a": 1}, {"a": 2}])
    assert propose([]) == {"a": 1}
    assert propose([Tried("r", {"a": 1}, None, None)]) == {"a": 2}
    assert propose([Tried("r", {"a": 1}, None, None)] * 2) is None


WRONG = ("cluster.tolerance_m", "=1", "a.x=", "a.x=1:2", "a.x=2:1:3", "a.x=1:2:1", "a.x=1:2:3:4", "a.x=a:b:c")


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_axis_is_refused(text: str):
    with pytest.raises(BadInput, match="--over"):
        parse_axis(text)


def test_a_grid_that_is_too_large_is_refused():
    with pytest.raises(BadInput, match="--latin"):
        grid([parse_axis("a.x=0:1:50"), parse_axis("a.y=0:1:50")])


def test_the_front_is_what_no_other_one_beats():
    scores = {"a": (1.0, 5.0), "b": (2.0, 2.0), "c": (3.0, 3.0), "d": (4.0, 0.0), "e": (2.0, 2.0), "f": (None, 0.0)}
    tried = [Tried(run, {}, *pair) for run, pair in scores.items()]
    assert [each.run for each in front(tried)] == ["a", "b", "d"]
    best = best_of(tried)
    assert best is not None
    assert best.run == "b"
    assert best_of([tried[-1]]) is None
    assert points_of(tried[-2:]) == [(2.0, 2.0)]  # what is unknown is not drawn as zero


def test_a_sweep_saves_the_best_as_a_preset(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """A LiDAR that ignores clusters of fewer than 50 points misses leads that the other one finds."""
    typed = ["sweep", str(fleet / "far-0.mcap"), str(fleet / "left-0.mcap"), "--out", str(tmp_path / "out")]
    typed += ["--over", "cluster.min_points=50,4", "--sensors", "lidar", "--lanes", "off", "--far-view-px", "0"]
    typed += ["--save", str(tmp_path / "best.yaml"), "--report", str(tmp_path / "sweep.html"), "--json"]
    assert _cipv(*typed) == 0
    said = json.loads(capsys.readouterr().out)
    (blind, sane) = said["tried"]
    assert (blind["set"], sane["set"]) == ({"cluster.min_points": 50}, {"cluster.min_points": 4})
    assert blind["labelled.lead_missed"] > sane["labelled.lead_missed"]
    assert said["best"] == sane["run"]
    assert from_yaml(tmp_path / "best.yaml", Params()).cluster.min_points == 4
    assert "<svg" in (tmp_path / "sweep.html").read_text(encoding="utf-8")
    assert latest_run(Store(str(tmp_path / "out"))) == sane["run"]


def test_without_both_scores_no_set_is_the_best(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    tried = [Tried("0" * 12, {"cluster.min_points": 4}, None, 0.0)]
    monkeypatch.setattr(ParameterSweep, "_run", lambda *_: (tried, ("late_leads", "phantom_leads")))
    typed = ["--over", "cluster.min_points=4", "--save", str(tmp_path / "best.yaml"), "--json"]
    assert _cipv("sweep", "sim:straight", "--out", str(tmp_path / "out"), *typed) == 1
    said = capsys.readouterr()
    assert json.loads(said.out)["best"] is None
    assert len(said.err.strip().splitlines()) == 1
    assert "no set has both scores" in said.err
    assert not (tmp_path / "best.yaml").exists()


def test_a_sweep_leaves_the_plan_of_a_batch_as_it_is(fleet: Path, tmp_path: Path):
    work = begun(plan_of(fleet, sensors="lidar"), tmp_path)
    before = (tmp_path / "batch.json").read_bytes()
    typed = ["--over", "cluster.min_points=49,50", "--sensors", "lidar", "--lanes", "off", "--far-view-px", "0"]
    assert _cipv("sweep", str(fleet / "far-0.mcap"), "--out", str(tmp_path), *typed) == 0
    assert (tmp_path / "batch.json").read_bytes() == before
    assert latest_run(work.store) != work.key.name


def test_a_search_runs_every_set_that_it_proposes(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    typed = ["sweep", str(fleet / "far-0.mcap"), "--out", str(tmp_path / "out"), "--search", "3", "--json"]
    typed += ["--over", "cluster.min_points=3:50:2", "--sensors", "lidar", "--lanes", "off", "--far-view-px", "0"]
    assert _cipv(*typed) == 0
    said = json.loads(capsys.readouterr().out)
    points = [each["set"]["cluster.min_points"] for each in said["tried"]]
    assert len(points) == 3
    assert all(isinstance(point, int) and 3 <= point <= 50 for point in points)
    assert said["best"] in {each["run"] for each in said["tried"]}


def test_what_is_wrong_is_said_before_any_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for more in (
        (),
        ("--over", "cluster.min_points=500"),
        ("--over", "no.such=1"),
        ("--over", "cluster.min_points=4,5", "--latin", "0"),
        ("--over", "cluster.min_points=4,5", "--search", "0"),
        ("--over", "cluster.min_points=4,5", "--search", "2", "--latin", "2"),
        ("--over", "cluster.min_points=4:500:3", "--search", "2"),
        ("--over", "cluster.min_points=4,5", "--save", str(tmp_path)),
        ("--over", "cluster.min_points=4,5", "--report", str(tmp_path)),
    ):
        assert _cipv("sweep", "sim:straight", "--out", str(tmp_path / "out"), *more) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def _cipv(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return int(end.value.code or 0)
