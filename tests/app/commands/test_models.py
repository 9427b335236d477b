"""`cipv models` as people read it."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from app.cli import main
from app.commands.models import ListModels, RegisterModel
from app.commands.serve import Serve
from pipeline.inference import model_registry
from pipeline.inference.known_networks import Task
from pipeline.inference.tuning import Gain, RunSettings, keep


def test_the_printed_list_has_every_address_and_command_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CIPV_HOME", str(tmp_path))
    monkeypatch.setenv("CIPV_DATA", str(tmp_path))
    assert ListModels()() == 0
    said = capsys.readouterr().out
    for known in model_registry.KNOWN:
        assert f"\n    {known.url}\n" in said
    assert "`cipv models pull yolox_tiny` (20.2 MB)" in said
    assert "`cipv models register PATH yolop --task lanes`" in said
    assert "● embedded  detector" in said, "the one that is used where no other is"


@pytest.mark.parametrize("task", get_args(Task))
@pytest.mark.parametrize("path", ["/nope.onnx", "embedded"], ids=["a path", "the name of another"])
def test_a_missing_file_to_register_is_just_missing(task: Task, path: str) -> None:
    with pytest.raises(model_registry.ModelError) as refused:
        RegisterModel(Path(path), "mine", task)()
    assert str(refused.value) == f"no file at {path}"


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        (Gain(12.0, 8.0), "CPU, 1 threads, enable all, with arena, 1.50 times as fast as the default"),
        (Gain(8.0, 8.0), "nothing is faster than the default (CPU, 1 threads, enable all, with arena)"),
        (None, "CPU, 1 threads, enable all, with arena"),
    ],
)
def test_the_list_says_what_tuning_chose_and_gained(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, gain: Gain | None, said: str
) -> None:
    monkeypatch.setenv("CIPV_HOME", str(tmp_path))
    assert ListModels()() == 0
    assert "tuned" not in capsys.readouterr().out
    keep(model_registry.EMBEDDED_FILE, RunSettings(("CPUExecutionProvider",), 1), gain)
    assert ListModels()() == 0
    assert f"\n    tuned for this machine: {said}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [
        "models list",
        "models pull yolox_nano",
        "models register FILE mine",
        "models tune embedded",
        "run sim:straight --frames 1",
        "evaluate sim:straight",
    ],
)
def test_a_store_that_cannot_be_made_is_not_a_damaged_one(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "file" / "cipv"))
    network = str(model_registry.EMBEDDED_FILE)
    with pytest.raises(SystemExit) as ended:
        main(command.replace("FILE", network).split())
    assert ended.value.code == 2
    reason = f"CIPV_HOME: {tmp_path}/file/cipv cannot be created, since {tmp_path}/file is not a folder"
    assert capsys.readouterr().err.splitlines()[-1] == f"cipv: {reason}"
    with pytest.raises(model_registry.ModelError, match="cannot be created"):
        Serve("sim:straight").engine()
