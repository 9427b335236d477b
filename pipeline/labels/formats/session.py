"""Labels inside an MCAP session: the native JSON as a message of ``/labels``, next to the data of the drive, and the
labels of each frame as Foxglove draws them."""

from __future__ import annotations

from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.labels.boxes import following
from pipeline.labels.formats.base import Imported, LabeledDrive
from pipeline.labels.formats.native import from_json, onto, to_json
from pipeline.labels.model import LabelSet, Origin
from pipeline.sources import open_source


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    """The whole recording as a new session, with these labels instead of existing ones."""
    from pipeline.labels.formats.drawn import drawn
    from pipeline.recording.save import save  # takes half a second to import, only needed to write a session

    out.parent.mkdir(parents=True, exist_ok=True)
    save(open_source(drive.uri), out, labels=to_json(labels), drawn=drawn(following(labels, drive)))
    return ()


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """Labels in this session, a clip of it, or a session that contains this clip. BadInput if it contains no labels."""
    from pipeline.recording.session.source import SessionSource

    session = SessionSource(str(path), str(path))
    try:
        data = session.labels()
    finally:
        session.close()
    if data is None:
        raise BadInput(f"{path}: a session without labels")
    return onto(from_json(data, str(path)), drive, str(path))
