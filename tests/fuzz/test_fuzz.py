"""The fuzzer finds planted faults, and no earlier finding comes back."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz import run as fuzzing
from tests.fuzz.run import Share, file_name, outcome, run
from tests.fuzz.target import Target
from tests.fuzz.targets import targets

FINDINGS = Path(__file__).parent / "findings"


def _stumbles(data: bytes) -> None:
    {}["x"]


def _hangs(data: bytes) -> None:
    while True:
        time.sleep(0.01)


def _hangs_unreachably(data: bytes) -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())  # as native code, which no signal ends
    while True:
        time.sleep(0.01)


def _swells(data: bytes) -> None:
    bytearray(64 << 30)


def _dies(data: bytes) -> None:
    os._exit(3)  # as a library's crash: nothing of Python's runs any more


@pytest.mark.parametrize(
    ("read", "says", "patience_s"),
    [
        (_stumbles, "KeyError in test_fuzz.py", 60.0),
        (_hangs, "takes too long", 60.0),
        (_hangs_unreachably, "the process ended or hung (-9)", 0.5),
        (_swells, "MemoryError", 60.0),
        (_dies, "the process ended or hung (3)", 60.0),
    ],
)
def test_each_kind_of_failure_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: object, says: str, patience_s: float
) -> None:
    """patience_s: short only where the process has to be killed. On a busy machine, a signal comes late."""
    monkeypatch.setattr(fuzzing, "BUDGET_S", 0.1)
    monkeypatch.setattr(fuzzing, "_PATIENCE_S", patience_s)

    def known() -> Iterator[dict[str, Target]]:
        yield {"x": Target((b"abc",), read)}  # type: ignore[arg-type]

    monkeypatch.setattr(fuzzing, "all_targets", known)
    (done,) = run(Share(seconds=0.2), build=tmp_path)
    assert says in done["findings"][0]
    assert all(finding.stat().st_size for finding in (tmp_path / "findings" / "x").iterdir())


def test_what_a_parser_imports_at_first_is_not_the_time_of_an_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fuzzing, "BUDGET_S", 0.1)
    began_s: list[float] = []

    def read(data: bytes) -> None:
        began_s.append(time.process_time())
        while time.process_time() < began_s[0] + 0.15:
            pass

    monkeypatch.setattr(fuzzing, "all_targets", lambda: iter([{"x": Target((b"abc", b"abcd"), read)}]))
    (done,) = run(Share(inputs=20), build=tmp_path)
    assert done == {"target": "x", "inputs": 20, "findings": []}


def test_inputs_are_shared_out_by_weight_and_a_process_that_ended_is_followed_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies_at_times(data: bytes) -> None:
        if data[:1] == b"z":
            os._exit(3)

    def known() -> Iterator[dict[str, Target]]:
        yield {"a": Target((b"abc",), bytes), "b": Target((b"zabc", b"abc"), dies_at_times, weight=3.0)}

    monkeypatch.setattr(fuzzing, "all_targets", known)
    monkeypatch.setattr(fuzzing, "_MOST_ENDS", 1000)
    once, thrice = run(Share(inputs=100), build=tmp_path)
    assert (once["inputs"], once["findings"]) == (25, [])
    assert (thrice["inputs"], thrice["findings"]) == (75, ["the process ended or hung (3)"])


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Target]:
    made = targets(tmp_path_factory.mktemp("fuzz"))
    for target in made.values():
        target.read(target.seeds[0])  # what is compiled the first time is not the parser's time
    return made


def test_every_parser_reads_what_it_is_made_for(known: dict[str, Target]):
    wrong = {
        name: outcome(target, seed)
        for name, target in known.items()
        for seed in target.seeds
        if outcome(target, seed) != ("read", False)
    }
    assert wrong == {}


def test_nothing_that_was_found_comes_back(known: dict[str, Target]):
    names = {file_name(name): name for name in known}
    again = {
        str(path): outcome(known[names[path.parent.name]], path.read_bytes())
        for path in FINDINGS.glob("*/*")
        if outcome(known[names[path.parent.name]], path.read_bytes())[1]
    }
    assert again == {}
