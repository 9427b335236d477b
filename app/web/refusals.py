"""Turns errors into HTTP responses of one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fastapi import HTTPException

from app.drive.background_runs import BackgroundRuns
from app.drive.open_recording import OpenRecording
from app.drive.run_registry import NoSuchRun
from app.labels.errors import BadAct, DatabaseError, NoSuchLabel, NotAllowed, Stale
from pipeline.common.errors import BadInput


@contextmanager
def refusing() -> Iterator[None]:
    """403 for what a role does not include, 404 for missing items, 409 for refused changes, 422 for invalid input, 503
    for a failing database. Stale passes through: the client must receive both versions."""
    try:
        yield
    except Stale:
        raise
    except (NoSuchRun, NoSuchLabel) as error:
        raise HTTPException(404, str(error)) from None
    except NotAllowed as error:
        raise HTTPException(403, str(error)) from None
    except BadAct as error:
        raise HTTPException(422, str(error)) from None
    except DatabaseError as error:
        raise HTTPException(503, str(error)) from None
    except BadInput as error:
        raise HTTPException(409, str(error)) from None


def open_recording(drives: BackgroundRuns) -> OpenRecording:
    """The recording whose whole drive is computed; 404 if there is none, as with live sensors."""
    if drives.recording is None:
        raise HTTPException(404, "no recording is open; for live sensors, record a session and open it")
    return drives.recording
