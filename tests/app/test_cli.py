"""Paths among a command's arguments, as a person types them."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

from app.cli import main


def test_a_home_directory_is_resolved_where_the_shell_leaves_it_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["live", "init", "~/car.yaml"])
    assert ended.value.code == 0
    assert [each.name for each in tmp_path.iterdir()] == ["car.yaml"]


def test_an_unknown_home_directory_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["live", "init", "~no_such_user_here/car.yaml"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "cipv: ~no_such_user_here/car.yaml: unknown home directory\n"
    assert not list(tmp_path.iterdir())


def test_the_command_line_can_be_started_as_a_module() -> None:
    ran = subprocess.run([sys.executable, "-m", "app.cli", "params"], capture_output=True, text=True, check=True)
    assert "cluster.z_weight" in ran.stdout


def test_the_version_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert said.startswith(f"CIPV Studio {version('cipv-studio')}, Python 3.")
    assert said.count("\n") == 1


def test_a_copy_that_was_not_installed_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("app.cli.version", unknown)
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith("CIPV Studio not installed, Python 3.")
