"""Every function that decodes is run by a target of the fuzzer, so a new parser needs one."""

from __future__ import annotations

from pathlib import Path

from tests.fuzz.decoders import decoders, ran
from tests.fuzz.targets import targets

NOT_FROM_OUTSIDE = {
    "app/core/kept_detections.py:KeptDetections.get": "the server's own cache, decoded as the detections of a batch",
    "app/core/pipe_messages.py:receive": "from the server's own processes",
    "app/drive/look_ahead/process.py:_serve": "from the server's own processes",
    "app/labels/projects/control.py:_results": "the server's own database",
    "app/labels/store/drive_labels.py:DriveLabels.version_json": "the server's own database, and checked by its hash",
    "app/labels/store/items.py:_item": "the server's own database",
    "app/labels/store/migrations/versions/0003_tags_of_ranges.py:upgrade": "the server's own database",
    "app/labels/store/values.py:unpack": "the server's own database",
    "app/commands/support/options.py:PipelineOptions.parameters": "typed by the user, and read by the parser of YAML",
    "pipeline/recording/session/velodyne_scan.py:scan_message": "writes; turns bytes of a checked length into an array",
    "pipeline/simulation/built_in.py:_title": "a file of this program",
    "pipeline/simulation/drawing/turned_view.py:_maps": "the key of a cache, from arrays",
    "pipeline/simulation/drawing/turned_view.py:_rays": "the key of a cache, from an array",
    "pipeline/sources/live/devices/udp.py:_received_at": "from the kernel",
    "pipeline/sources/live/devices/video_stream.py:read_stream": "a stream; the library decodes it as it does files",
}
"""Decode what no other program or person has made, with the reason."""


def test_every_parser_is_a_target(tmp_path: Path) -> None:
    known = targets(tmp_path)

    def read_all() -> None:
        for target in known.values():
            for seed in target.seeds:
                target.read(seed)

    assert decoders() - ran(read_all) - NOT_FROM_OUTSIDE.keys() == set()


def test_what_is_left_out_exists() -> None:
    assert NOT_FROM_OUTSIDE.keys() - decoders() == set()
