"""Pages with a playhead of their own, as for labeling, beside those that share one."""

from __future__ import annotations

import json
from pathlib import Path

from pipeline.params import Params, with_changes
from pipeline.recording.recording_state import RecordingState
from tests.app.streaming.stream_site import (
    Site,
    go_to,
    header_where,
    index_of,
    next_header,
    sequence_of,
)

RECORDING = RecordingState(Path("a.mcap"), (Path("a.mcap"),), 1, 0.1, 9, 0, None)


def test_a_page_with_its_own_playhead_is_moved_by_nobody_and_moves_nobody(site: Site):
    with site.connected() as own, site.connected() as other:
        next_header(own)
        own.send(json.dumps({"own": 3}))
        mine = header_where(own, lambda header: index_of(header) == 3)
        assert mine["result"]["frame"] != site.first.processed.result.frame  # type: ignore[union-attr]
        site.show(5, playing=True)
        assert index_of(header_where(other, lambda header: sequence_of(header) == 5)) == 5
        own.send(json.dumps({"own": 2}))
        came = [next_header(own)]
        while index_of(came[-1]) == 3:  # its own frame again, since the state of the others has changed
            came.append(next_header(own))
        assert index_of(came[-1]) == 2, "what all are shown did not come in between"
        assert not any(each["state"]["playing"] for each in came)
        own.send(json.dumps({"own": None}))
        assert index_of(header_where(own, lambda header: index_of(header) != 2)) == 5


def test_playback_is_paused_when_no_page_follows_it(site: Site):
    with site.connected() as watching, site.connected() as labeling:
        next_header(watching)
        next_header(labeling)
        site.show(1, playing=True)
        go_to(labeling, 3)
        assert site.pauses == [], "somebody watches"
        watching.send(json.dumps({"own": 2}))
        header_where(watching, lambda header: index_of(header) == 2)
        assert len(site.pauses) == 1
        site.show(2, playing=True, recording=RECORDING)
        go_to(labeling, 1)
        assert len(site.pauses) == 1, "what is recorded goes on"
        site.show(3, playing=True, live=True)
        go_to(labeling, 2)
        assert len(site.pauses) == 1, "sensors go on"
    with site.connected("?own=1") as reloaded:
        header_where(reloaded, lambda header: index_of(header) == 1)  # it has come
        site.show(4, playing=True)
        go_to(reloaded, 2)
        assert len(site.pauses) == 2, "who watched has gone"


def test_a_page_with_its_own_playhead_gets_its_frame_again_with_other_parameters_and_after_a_loss(site: Site):
    with site.connected("?own=3") as own:
        assert index_of(next_header(own)) == 3
        other = with_changes(Params(), {"cluster.min_points": 7})
        site.show(6, params=other)
        again = header_where(own, lambda header: sequence_of(header) == 6)  # its own exact frame may come before
        assert index_of(again) == 3
