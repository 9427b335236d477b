"""A network is tuned once after its first use, by a process that nobody waits for."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from app.commands.support import first_use_tuning
from app.commands.support.first_use_tuning import FirstUseTuning
from pipeline.inference.tuning import is_tuned, kept_way, untuned
from pipeline.vision.detector import Detector, open_detector
from tests.pipeline.vision import networks


@pytest.fixture
def network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Detector:
    """A small network in its own store."""
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    return open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), None)


def test_what_is_found_is_used_at_the_next_opening(network: Detector, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_use_tuning, "read_cpu_times", lambda: None)  # as where a system does not tell its load
    monkeypatch.setattr(first_use_tuning, "_IDLE_S", 0.0)
    assert first_use_tuning._tuned(network.path)
    assert is_tuned(network.path)
    assert kept_way(network.path, 2).optimisation == untuned(2).optimisation


def test_nothing_is_kept_that_was_measured_while_the_machine_was_busy(
    network: Detector, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(first_use_tuning, "_is_idle", lambda: True)
    monkeypatch.setattr(first_use_tuning, "load_warning", lambda *_: "the machine was not idle")
    assert not first_use_tuning._tuned(network.path)
    assert not is_tuned(network.path)


def test_the_process_ends_with_the_program_that_started_it(network: Detector) -> None:
    child = subprocess.Popen(
        [sys.executable, "-m", first_use_tuning.__name__, str(network.path)], stdin=subprocess.PIPE
    )
    child.communicate(timeout=120)  # closes its standard input
    assert child.returncode == 0


def test_each_network_is_tuned_once_and_none_after_the_end(
    network: Detector, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tuned: list[Path] = []
    second = open_detector(str(networks.yolox(tmp_path / "second.onnx")), None)
    both = threading.Event()

    def tune(_: FirstUseTuning, path: Path) -> None:
        tuned.append(path)
        if path == second.path:
            both.set()

    monkeypatch.setattr(FirstUseTuning, "_tune", tune)
    with FirstUseTuning(delay_s=0.0) as tuning:
        for opened in (network, None, network, second):
            tuning.used(opened)
        assert both.wait(60.0)
    assert tuned == [network.path, second.path]
    with FirstUseTuning(delay_s=3600.0) as tuning:
        tuning.used(network)
    assert tuned == [network.path, second.path]
