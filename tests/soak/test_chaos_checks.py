"""The checks of a chaos soak notice what they are for: a lost act, one that is back, a wrong frame, a gap that is not
said, a sensor that stays away, a recording that ended."""

from __future__ import annotations

import random
import threading
from pathlib import Path

import pytest
from sqlalchemy import delete, update

from app.labels.store.database import Database
from app.labels.store.tables import ItemRow
from pipeline.recording.session.writer import SessionWriter
from tests.app.engine.recording_helpers import Recording
from tests.app.labels.server_process import forking
from tests.app.waiting import wait_until
from tests.pipeline.recording.frames import ABOUT, full, write
from tests.soak.chaos import live
from tests.soak.chaos.figures import Figures
from tests.soak.chaos.live import LiveCar
from tests.soak.chaos.recorder import read_back
from tests.soak.chaos.server import LabelledServer, session


@pytest.mark.soak
def test_a_lost_act_one_that_is_back_and_a_wrong_frame_are_noticed(tmp_path: Path) -> None:
    figures, stop, file = Figures(), threading.Event(), tmp_path / "labels.db"
    with forking() as context:
        server = LabelledServer(context, f"sqlite:///{file}", session(tmp_path / "a.mcap"), figures)
        try:
            labelling = threading.Thread(target=server.label, args=(stop,))
            labelling.start()
            assert wait_until(lambda: figures.acts > 3)
            stop.set()
            labelling.join()
            server.check()
            assert figures.wrong == []
            lost, *_, removed = server._said
            database = Database.in_file(file)
            with database.writing() as connection:
                connection.execute(update(ItemRow).where(ItemRow.id == lost).values(removed=True))
            server._gone.add(removed)
            server.check()
            assert figures.wrong == [f"track {lost} is lost", f"track {removed} is back"]
            with database.writing() as connection:
                connection.execute(delete(ItemRow))
            database.close()
            recording = Recording()
            (tmp_path / "a.mcap").unlink()
            write(tmp_path / "a.mcap", [recording.frame(index) for index in (*range(29), 28)])
            server.kill()
            server._said, server._gone = {}, set()
            server.check()
            assert [text for text in figures.wrong if text.startswith("column distance_m")]
        finally:
            server.process.kill()


@pytest.mark.soak
def test_a_gap_that_is_not_said_is_noticed(tmp_path: Path) -> None:
    for notes, wrong in ((("2 frames were dropped",), []), ((), ["2 frames are missing, 0 are said"])):
        figures, path = Figures(), tmp_path / f"{len(notes)}.mcap"
        writer = SessionWriter(path, ABOUT)
        for index in (0, 1, 4, 5):
            writer.write(full(index))
        for text in notes:
            writer.write_note(text)
        writer.flush()
        writer.abandon()
        assert read_back(path, figures) == 4
        assert figures.wrong == wrong
        path.with_name("b.mcap").unlink()


@pytest.mark.soak
def test_a_sensor_that_stays_away_and_a_recording_that_ended_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "_DRIVES_AGAIN_WITHIN_S", 0.0)
    figures = Figures()
    car = LiveCar(tmp_path / "live", random.Random(1), figures)
    car.check()
    assert [text.partition(":")[0] for text in figures.wrong] == [
        "the lidar did not come back",
        "the camera did not come back",
        "the gnss did not come back",
        "the live recording ended",
    ]
