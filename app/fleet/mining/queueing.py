"""Puts seconds into the labeling queue: as a tag on their frames, in the label database."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, cast

from app.fleet.mining.choose import ChosenSecond
from app.labels.acts.tags import put_tag
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels, info_of
from pipeline.labels.model import COUNTED_STATES, NEXT_TAG, FrameTag, LeadRange, Origin
from pipeline.sources import open_source

if TYPE_CHECKING:
    from app.labels.store.draft import Draft


class MiningQueue:
    """The labeling queue of a database, by address of the recording. Recordings are opened when they are first asked
    for. For one thread."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._opened: dict[str, DriveLabels] = {}

    def is_known(self, address: str, first: int, last: int) -> bool:
        """Whether a person has labelled the lead in all of these frames. Raises SourceError if the recording cannot be
        opened."""
        leads = [cast("LeadRange", item.value) for item in self._of(address).items("lead").values()]
        sure = [each for each in leads if each.state in COUNTED_STATES]
        said = {n for lead in sure for n in range(lead.first, lead.last + 1)}
        return set(range(first, last + 1)) <= said

    def is_queued(self, address: str, first: int, last: int) -> bool:
        """Whether any of these frames is in the queue. Raises SourceError if the recording cannot be opened."""
        tags = [cast("FrameTag", item.value) for item in self._of(address).items("tag").values()]
        return any(tag.tag == NEXT_TAG and tag.first <= last and first <= tag.last for tag in tags)

    def put(self, chosen: Iterable[ChosenSecond], person: str) -> int:
        """Tag the frames, one act per recording, which the person can undo. Returns how many recordings it were."""
        by_address: dict[str, list[ChosenSecond]] = {}
        for each in chosen:
            by_address.setdefault(each.address, []).append(each)
        now_ms = int(time.time() * 1000)
        for address, seconds in by_address.items():

            def tag(draft: Draft, seconds: list[ChosenSecond] = seconds) -> str:
                for each in seconds:
                    put_tag(draft, FrameTag(each.first, each.last, NEXT_TAG, Origin("pipeline", each.text, now_ms)))
                return f"queued {len(seconds)} seconds for labeling"

            self._of(address).log.act("tag", person, tag)
        return len(by_address)

    def _of(self, address: str) -> DriveLabels:
        if address not in self._opened:
            source = open_source(address)
            count = len(source)
            info = info_of(source, lambda: tuple(f"{n}" for n in range(count)))
            self._opened[address] = DriveLabels(self._database, info)
        return self._opened[address]
