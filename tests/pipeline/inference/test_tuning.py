"""The fastest way is kept for one file on one machine, and only if it gives the same outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from time import sleep

import numpy as np
import pytest

from pipeline.common.fast_replace import evolve
from pipeline.inference import tuning
from pipeline.inference.runtime import open_session, ways_of
from pipeline.inference.tuning import (
    Gain,
    RunSettings,
    Trial,
    fastest,
    is_tuned,
    keep,
    keep_fastest,
    kept_gain,
    kept_way,
    tune,
    untuned,
)
from pipeline.types import F32
from tests.pipeline.vision import networks

CPU = "CPUExecutionProvider"


@pytest.fixture
def network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small network in its own store."""
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    return networks.yolox(tmp_path / "tiny.onnx")


def test_a_kept_way_is_the_one_it_runs_in(network: Path) -> None:
    keep(network, RunSettings((CPU,), 3, "ORT_ENABLE_BASIC", arena=False))
    options = open_session(network.read_bytes(), network, 2).get_session_options()
    assert options.intra_op_num_threads == 3
    assert options.graph_optimization_level.name == "ORT_ENABLE_BASIC"
    assert not options.enable_cpu_mem_arena


def test_it_belongs_to_the_file_the_processor_and_the_version(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep(network, RunSettings((CPU,), 3))
    assert kept_way(network, 2).threads == 3
    monkeypatch.setattr(tuning, "_processor", lambda: "another")
    assert kept_way(network, 2) == untuned(2)


def test_another_file_runs_untuned(network: Path, tmp_path: Path) -> None:
    keep(network, RunSettings((CPU,), 3))
    other = tmp_path / "other.onnx"
    other.write_bytes(network.read_bytes() + b"\0")
    assert kept_way(other, 2) == untuned(2)


@pytest.mark.parametrize("damage", ["no JSON", "[]", '{"a": 1}'])
def test_what_is_kept_may_be_damaged(network: Path, damage: str) -> None:
    keep(network, RunSettings((CPU,), 3))
    (tuning.store() / "tuning.json").write_text(damage, encoding="utf-8")
    assert kept_way(network, 2) == untuned(2)


def test_a_number_of_threads_without_end_is_none(network: Path) -> None:
    keep(network, RunSettings((CPU,), 3))
    file = tuning.store() / "tuning.json"
    file.write_text(file.read_text(encoding="utf-8").replace('"threads": 3', '"threads": 1e999'), encoding="utf-8")
    assert "1e999" in file.read_text(encoding="utf-8")
    assert kept_way(network, 2) == untuned(2)


@pytest.mark.parametrize(
    "way", [RunSettings(("NoSuchProvider",), 2), RunSettings((CPU,), 0), RunSettings((CPU,), 2, "FASTEST")]
)
def test_a_way_that_cannot_be_gone_is_not(network: Path, way: RunSettings) -> None:
    keep(network, way)
    assert kept_way(network, 2) == untuned(2)


def test_every_way_of_a_real_network_is_tried_and_gives_its_outputs(network: Path) -> None:
    trials = list(tune(ways_of(network), 2, rounding=True))
    assert trials[0].way == untuned(2)
    ways = [trial.way for trial in trials]
    in_turns = ways[-2:] if ways.count(ways[0]) > 1 else []
    assert len(set(ways)) == len(ways) - len(in_turns) >= 4
    assert not [trial for trial in trials if trial.best_ms is None]


def _made(
    slow: Callable[[RunSettings], bool], output: Callable[[RunSettings], float]
) -> Callable[[RunSettings], Callable[[], Sequence[F32]]]:
    """Settings that take 5 ms or no time, and return one number."""

    def run(way: RunSettings) -> Callable[[], Sequence[F32]]:
        def once() -> Sequence[F32]:
            if slow(way):
                sleep(0.005)
            return [np.array([output(way)], np.float32)]

        return once

    return run


def test_the_faster_one_is_chosen_unless_its_outputs_differ() -> None:
    def is_slow(way: RunSettings) -> bool:
        return way.optimisation != "ORT_ENABLE_BASIC"

    honest = list(tune(_made(is_slow, lambda _: 1.0), 2, rounding=True))
    assert fastest(honest).way.optimisation == "ORT_ENABLE_BASIC"
    wrong = list(tune(_made(is_slow, lambda way: 1.0 if is_slow(way) else 1.1), 2, rounding=True))
    assert fastest(wrong).way.optimisation != "ORT_ENABLE_BASIC"
    assert {trial.refused for trial in wrong if not is_slow(trial.way)} == {"its outputs differ"}


def test_results_do_not_depend_on_tuning_unless_rounding_is_permitted() -> None:
    """With one thread, outputs differ in the last bit."""

    def is_slow(way: RunSettings) -> bool:
        return way.threads != 1 and way.arena

    def output(way: RunSettings) -> float:
        return 1.0 if way.threads != 1 else float(np.nextafter(np.float32(1.0), np.float32(2.0)))

    trials = list(tune(_made(is_slow, output), 2))
    assert {(trial.way.optimisation, trial.way.providers) for trial in trials} == {
        (untuned(2).optimisation, untuned(2).providers)
    }
    assert {trial.refused for trial in trials if trial.way.threads == 1} == {"its outputs differ"}
    assert fastest(trials).way == evolve(untuned(2), arena=False)
    assert fastest(list(tune(_made(is_slow, output), 2, rounding=True))).way.threads == 1


def test_threads_and_arena_leave_the_outputs_of_a_network_as_they_are(network: Path) -> None:
    trials = list(tune(ways_of(network), 2))
    assert len(trials) >= 3
    assert not [trial for trial in trials if trial.refused]
    best = keep_fastest(network, trials)
    assert is_tuned(network)
    assert kept_way(network, 2) == best.way


def test_a_gain_within_the_spread_changes_nothing() -> None:
    usual, little = Trial(RunSettings((CPU,), 2), 10.0), Trial(RunSettings((CPU,), 1), 9.9)
    assert fastest([usual, little]) is usual
    assert fastest([usual, little, Trial(RunSettings((CPU,), 4), 5.0)]).way.threads == 4


def test_the_best_is_measured_again_in_turns_with_the_default_and_its_gain_is_kept(network: Path) -> None:
    usual, lucky, other = (RunSettings((CPU,), threads) for threads in (2, 1, 4))
    alone = [Trial(usual, 10.0), Trial(lucky, 8.0), Trial(other, 8.5)]
    best = keep_fastest(network, [*alone, Trial(usual, 8.1), Trial(lucky, 8.0)])
    assert (best.way, kept_way(network, 2), kept_gain(network)) == (usual, usual, Gain(8.1, 8.1))
    keep_fastest(network, [*alone, Trial(usual, 10.0), Trial(lucky, 8.0)])
    assert (kept_way(network, 2), kept_gain(network)) == (lucky, Gain(10.0, 8.0))

    honest = list(tune(_made(lambda way: way.threads != 1, lambda _: 1.0), 2))
    assert [trial.way.threads for trial in honest[-2:]] == [2, 1]
    assert fastest(honest).way.threads == 1


def test_settings_of_before_gains_were_kept_are_still_used(network: Path) -> None:
    keep(network, RunSettings((CPU,), 3))
    assert kept_way(network, 2).threads == 3
    assert kept_gain(network) is None
