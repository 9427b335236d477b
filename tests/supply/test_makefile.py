"""Which Python `make install` takes, on machines with several, or with none that is new enough."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def machine(folder: Path, pythons: dict[str, str]) -> Path:
    """A fresh checkout on a machine with these interpreters: name → version, each this one, under that version."""
    for name in ("Makefile", "pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "bin").mkdir()
    for name, version in pythons.items():
        tuple_, script = tuple(map(int, version.split("."))), folder / "bin" / name
        program = f"import sys; sys.version_info = {tuple_}; sys.version = '{version} (main)'; exec(sys.argv[1])"
        script.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{program}" "$2"\n', encoding="utf-8")
        script.chmod(0o755)
    return folder


def install(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["make", *options, ".venv/.installed"],
        cwd=folder,
        env={"PATH": f"{folder / 'bin'}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("pythons", "taken"),
    [
        ({"python3": "3.11.2", "python3.13": "3.13.1"}, "python3"),
        ({"python3": "3.14.0", "python3.13": "3.13.1", "python3.12": "3.12.3"}, "python3.13"),
        ({"python3": "3.10.12", "python3.13": "3.14.0", "python3.12": "3.12.3"}, "python3.12"),
        ({f"python3{minor}": "3.14.0" for minor in ("", ".13", ".12", ".11")}, "python3"),
    ],
)
def test_the_python_with_packages_for_everything_is_taken(tmp_path: Path, pythons: dict[str, str], taken: str):
    assert f"|| {taken} -m venv .venv" in install(machine(tmp_path, pythons), "--dry-run").stdout


def test_a_python_that_is_too_old_is_named(tmp_path: Path):
    old = {f"python3{minor}": "3.10.12" for minor in ("", ".13", ".12", ".11")}
    done = install(machine(tmp_path, old))
    assert done.returncode
    assert done.stderr.splitlines()[0] == (
        "Python 3.11 or newer is needed; python3 is 3.10.12. Name another with make PYTHON=…"
    )
    assert not (tmp_path / ".venv").exists()
