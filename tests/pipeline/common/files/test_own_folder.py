"""Where networks and compiled kernels are kept, also for an account that may write nowhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from pipeline.common.files import own_folder

ROOT = Path(__file__).resolve().parents[4]


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_it_is_in_the_home_of_the_account_or_where_it_says(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("CIPV_HOME", raising=False)
    monkeypatch.setenv("HOME", "/home/bob")
    assert own_folder.own_folder() == Path("/home/bob/.cache/cipv")
    monkeypatch.setenv("CIPV_HOME", "/data/cipv")
    assert own_folder.own_folder() == Path("/data/cipv")


def test_an_account_without_a_home_has_one_among_the_temporary_files(temporary: Path, monkeypatch: pytest.MonkeyPatch):
    def no_entry() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("CIPV_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_entry)
    assert own_folder.own_folder() == temporary / f"cipv-{os.getuid()}"
    assert own_folder.own_folder().stat().st_mode & 0o777 == 0o700
    assert own_folder.own_folder() == temporary / f"cipv-{os.getuid()}", "the next start finds what this one compiled"


@pytest.mark.parametrize("made_by", ["a link", "a file", "a folder open to all"])
def test_a_folder_that_others_can_write_to_is_not_trusted(temporary: Path, made_by: str):
    usual, elsewhere = temporary / f"cipv-{os.getuid()}", temporary / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    if made_by == "a link":
        usual.symlink_to(elsewhere)
    elif made_by == "a file":
        usual.write_text("")
    else:
        usual.mkdir()
        usual.chmod(0o777)
    found = own_folder.private_folder()
    assert found not in (usual, elsewhere)
    assert found.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("home", ["writable", "missing"])
def test_kernels_compile_where_the_program_is_read_only(tmp_path: Path, home: str):
    shutil.copytree(ROOT / "pipeline", tmp_path / "pipeline", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (tmp_path / "pipeline", *(each for each in (tmp_path / "pipeline").rglob("*") if each.is_dir())):
        (folder / "__pycache__").write_text("a file, so that nobody can make a folder of this name, not even root")
    (tmp_path / "temporary").mkdir()
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(tmp_path),
        "TMPDIR": str(tmp_path / "temporary"),
        "HOME": str(tmp_path / "home") if home == "writable" else "/dev/null",
    }
    program = (
        "import numpy as np; from pipeline.common.geometry import iou_matrix as f; print(f(*[np.ones((1, 4))] * 2))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    kept = tmp_path / ("home/.cache/cipv" if home == "writable" else f"temporary/cipv-{os.getuid()}") / "kernels"
    assert [*kept.rglob("*.nbc")], "it need not be compiled again"


def test_a_folder_below_a_file_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    (tmp_path / "file").touch()
    monkeypatch.delenv("CIPV_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    reason = f"{tmp_path}/file/.cache/cipv cannot be created, since {tmp_path}/file is not a folder"
    assert own_folder.why_impossible(own_folder.own_folder()) == f"{reason}; set CIPV_HOME to a folder for networks"
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "new"))
    assert own_folder.why_impossible(own_folder.own_folder() / "models") is None
