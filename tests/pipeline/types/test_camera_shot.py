"""Images as the camera sent them, decoded by several threads at once: the pipeline shows what the recorder writes."""

from __future__ import annotations

import threading

import av
import numpy as np

from pipeline.types import U8
from pipeline.types.camera_shot import Shot

FRAMES, PATIENCE_S = 200, 60.0


def video_frame(seed: int) -> av.VideoFrame:
    pixels = np.random.default_rng(seed).integers(0, 255, (72, 128, 3), dtype=np.uint8)
    return av.VideoFrame.from_ndarray(np.kron(pixels, np.ones((10, 10, 1), np.uint8)), "bgr24").reformat(
        format="yuv420p", threads=1
    )


def test_a_frame_of_a_video_decoded_by_two_threads_at_once() -> None:
    frames = [video_frame(seed % 4) for seed in range(FRAMES)]
    expected = [Shot(frame=video_frame(seed)).bgr() for seed in range(4)]
    together, wrong, done = threading.Barrier(2), list[int](), list[int]()

    def decode() -> None:
        for number, frame in enumerate(frames):
            together.wait(PATIENCE_S)
            bgr = Shot(frame=frame).bgr()
            if not np.array_equal(bgr, expected[number % 4]):
                wrong.append(number)
        done.append(1)

    threads = [threading.Thread(target=decode, daemon=True) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert (done, wrong) == ([1, 1], []), "a converter shared by threads hangs"
    first: U8 | None = expected[0]
    assert first is not None
    assert first.shape == (720, 1280, 3)
