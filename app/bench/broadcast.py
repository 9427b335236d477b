"""The server side of the client benchmark, in its own process so that its CPU time can be measured separately.

    python -m app.bench.broadcast [--deflate]

This streams frames of ``sim:straight`` at 10 Hz through the product's own stream, compressed or not. It prints its
port, and then its CPU time in seconds for each line that it reads. It exits at the end of its input.
"""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import replace
from itertools import count

import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute

from app.core.detection_cache import DetectionCache
from app.core.server_address import listen_socket
from app.engine.processed_frame import ProcessedFrame
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from app.streaming.stream import Stream
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.sources import open_source

RATE_HZ = 10.0
FRAMES = 20


def main() -> None:
    """Run until standard input ends."""
    stream, frames = Stream(), _frames()
    app = Starlette(routes=[WebSocketRoute("/", stream.serve)])
    config = uvicorn.Config(app, log_level="warning", access_log=False, ws_per_message_deflate="--deflate" in sys.argv)
    server, bound = uvicorn.Server(config), listen_socket("127.0.0.1", 0)
    threading.Thread(target=lambda: server.run(sockets=[bound]), daemon=True).start()
    threading.Thread(target=_publish, args=(stream, frames), daemon=True).start()
    while not server.started:
        time.sleep(0.01)
    print(bound.getsockname()[1], flush=True)
    for _ in sys.stdin:
        print(time.process_time(), flush=True)


def _publish(stream: Stream, frames: list[ProcessedFrame]) -> None:
    """Publish a frame every 0.1 s by the clock; a late frame does not delay the next one."""
    start = time.monotonic()
    for sequence in count(1):
        shown = Snapshot(Params(), uri="sim:straight", index=sequence, sequence=sequence, made_unix_s=time.time())
        stream.publish(replace(shown, processed=frames[sequence % len(frames)]))
        time.sleep(max(0.0, start + sequence / RATE_HZ - time.monotonic()))


def _frames() -> list[ProcessedFrame]:
    source = open_source("sim:straight")
    pipeline, params = SeekablePipeline(source, Detectors(None, None), DetectionCache(), "both"), Params()
    return [pipeline.advance(index, params) for index in range(FRAMES)]


if __name__ == "__main__":
    main()
