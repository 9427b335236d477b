"""`cipv record live:…` over real sockets: what the sensors sent is in the session, clouds or raw packets."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
import yaml

from app.cli import main
from app.commands.record import Record
from app.commands.support.options import PipelineOptions, SourceOptions
from pipeline.params import SyncParams
from pipeline.recording.session.source import SessionSource
from pipeline.types import Frame, StreamHealth
from tests.app.engine.test_live_engine import Sensors
from tests.pipeline.sources.live.bench import endless
from tests.pipeline.sources.live.rig import Replaying, loopback_config


class Unplugged(Sensors):
    """Sensors that deliver two frames and then make the pipeline fail."""

    lidar_mount = None

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        if self.given == 2:
            raise RuntimeError("unplugged")
        self.give(self.given + 1)
        return super().next(timeout_s, params)


def test_what_was_recorded_until_an_error_is_a_whole_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sensors = Unplugged()
    monkeypatch.setattr(SourceOptions, "open_any", lambda self: sensors)
    out = tmp_path / "drive.mcap"
    with pytest.raises(RuntimeError, match="unplugged"):
        Record(SourceOptions("live:test"), out, PipelineOptions(lanes="off"))()
    session = SessionSource("a", str(out))
    assert (len(session), session.file.directory.is_cut) == (2, False)
    received_ns = [session.log_time_ns(index) for index in range(2)]
    assert received_ns == [10**18 + session.t_ns(index) for index in range(2)]


class Silent(Sensors):
    """Sensors that deliver nothing; when they are asked why, Ctrl-C is pressed."""

    lidar_mount = None
    was_pressed = False

    def health(self) -> tuple[StreamHealth, ...]:
        if not self.was_pressed:
            self.was_pressed = True
            os.kill(os.getpid(), signal.SIGINT)
        return super().health()


def test_sensors_that_give_nothing_are_said_and_leave_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sensors = Silent()
    sensors.state = "absent"
    monkeypatch.setattr(SourceOptions, "open_any", lambda self: sensors)
    assert Record(SourceOptions("live:test"), tmp_path, PipelineOptions(lanes="off"))() == 1
    said = capsys.readouterr().err
    assert said.count("cipv: waiting for sensors: lidar absent") == 1
    assert "no data received; nothing saved" in said
    assert list(tmp_path.iterdir()) == []
    assert sensors.tapped is None


class Overwhelming(Sensors):
    """Sensors that tick three times for every processed frame, until Ctrl-C is pressed."""

    lidar_mount = None
    was_pressed = False

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        if self.given >= 6:
            if not self.was_pressed:
                self.was_pressed = True
                os.kill(os.getpid(), signal.SIGINT)
            return super().next(timeout_s, params)
        for _ in range(3):
            self.give(self.given + 1)
        return super().next(timeout_s, params)


def test_ticks_that_the_line_was_too_slow_for_are_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(SourceOptions, "open_any", lambda self: Overwhelming())
    assert Record(SourceOptions("live:test"), tmp_path / "a.mcap", PipelineOptions(lanes="off"))() == 0
    said = capsys.readouterr().err
    assert "2 frames" in said
    assert "the pipeline was too slow for 4 ticks" in said


@pytest.mark.parametrize("arguments", [(), ("--packets",)], ids=["clouds", "packets"])
def test_live_sensors_are_recorded(arguments: tuple[str, ...], tmp_path: Path) -> None:
    config = loopback_config()
    file, out = tmp_path / "car.yaml", tmp_path / "drive.mcap"
    file.write_text(yaml.safe_dump(config.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    typed = ["record", f"live:{file}", "--out", str(out), "--seconds", "2", "--lanes", "off", *arguments]
    with Replaying(config, endless()), pytest.raises(SystemExit) as end:
        main(typed)
    assert end.value.code == 0
    session = SessionSource("a", str(out))
    frames = [session.frame(index) for index in range(len(session))]
    assert len(frames) >= 5
    with_sweep = sum(frame.sweep is not None for frame in frames)
    assert with_sweep >= len(frames) // 2, [frame.notes for frame in frames]
    assert any(frame.image is not None and frame.image.encoded is not None for frame in frames)
    assert any(frame.gnss is not None for frame in frames)
    assert any(frame.ego is not None for frame in frames)
    assert all(frame.streams for frame in frames)
    results = [session.result(index) for index in range(len(session))]
    assert all(result is not None and result["sensors"]["lidar"]["state"] for result in results)
    stored = {stream.channel.topic for stream in session.file.messages()}
    assert ("/lidar/packets" in stored, "/lidar/points" in stored) == (bool(arguments), not arguments)
    images = list(session.file.messages(("/camera/image",)))
    shown = {frame.image.t_ns for frame in frames if frame.image is not None}
    assert len(images) > len(shown), "those that came between ticks, too"
    assert shown <= {each.publish_time_ns for each in images}
    assert len({each.publish_time_ns for each in images}) == len(images)
    if not arguments:
        clouds = [each.publish_time_ns for each in session.file.messages(("/lidar/points",))]
        assert {frame.sweep.t_ns for frame in frames if frame.sweep is not None} <= set(clouds)
        assert len(set(clouds)) == len(clouds), "each once, when it came"
    for index, result in enumerate(results):
        assert result is not None
        sweep = frames[index].sweep
        assert result["sensors"]["lidar"]["points"] in (None, len(sweep.points) if sweep is not None else None)
