"""Benchmarks the page with many labels in a real browser: the time from a seek until the frame, its labels in the
bird's-eye view and their edges in the camera image are painted."""

from __future__ import annotations

import json
import time
from urllib.parse import urlencode
from urllib.request import Request

from app.bench.page.browser import opened
from app.bench.page.devtools import Browser
from app.core.local_requests import open_local
from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.native import from_json, to_json
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting

MOST = 100_000
_LIFE = 100
"""Number of frames in which each synthetic vehicle is present: 10 s at 10 Hz."""
_SEEKS, _FAR, _PAUSE_MS, _PATIENCE_MS = 24, 37, 120, 30_000
_ALL_THERE_WITHIN_S, _ASK_EVERY_S = 300.0, 0.5
_PERSON = "Bench"

_BEGIN = """(person) => {
  localStorage.setItem("cipv.person", JSON.stringify(person));
  document.querySelector("#label-button").click();
}"""
_ARE_THERE = """async ([count, patience]) => {
  const { get, on } = await import("/js/core/store.js");
  await new Promise((done, fail) => {
    setTimeout(() => fail(new Error("the labels did not arrive")), patience);
    const look = () => (get("labels")?.tracks.size ?? 0) >= count && get("projected") && done();
    on(["labels", "projected"], look);
    look();
  });
}"""
_SEEK = """async ([frames, pause, patience]) => {
  const { seekTo } = await import("/js/drive/seek.js"), { get, on } = await import("/js/core/store.js");
  const { isKnown } = await import("/js/labeling/state/sightings.js");
  const after = new MessageChannel(), waits = [];
  let holds = () => false, told = () => {};
  // the message comes after the style, layout and drawing of the animation frame that was asked for
  after.port1.onmessage = () => told();
  const look = () => requestAnimationFrame(() => after.port2.postMessage(0));
  on(["frame", "labelFrames", "projected"], look);
  for (const index of frames) {
    const start = performance.now(), took = {};
    await new Promise((done, fail) => {
      setTimeout(() => fail(new Error("the labels of a frame were not painted")), patience);
      told = () => {
        const now = performance.now() - start, isThere = get("frame").state.index === index;
        const edges = get("projected");
        if (isThere) took.frame ??= now;
        if (isThere && isKnown(index)) took.plan ??= now;
        if (took.plan !== undefined && edges?.frame === index && edges.pixels.size) took.image ??= now;
        if (took.image !== undefined) done();
      };
      seekTo(index);
    });
    waits.push(took);
    await new Promise((done) => setTimeout(done, pause));
  }
  return waits;
}"""


def labelled(running: Browser, address: str, count: int) -> dict[str, list[float]]:
    """Milliseconds from each seek to the frame, to its labels in the bird's-eye view and to their edges in the camera
    image, on a paused recording of ``count`` frames that is filled with labels."""
    tracks = _fill(address)
    page = opened(running, address)
    page.call(_BEGIN, _PERSON)
    page.call(_ARE_THERE, [tracks, _PATIENCE_MS])
    frames = [(_FAR * (n + 1)) % count for n in range(_SEEKS)]
    waits = page.call(_SEEK, [frames, _PAUSE_MS, _PATIENCE_MS])
    page.close()
    return {what: [each[what] for each in waits] for what in ("frame", "plan", "image")}


def many(drive: LabelSet, labels: int = MOST) -> LabelSet:
    """Synthetic vehicles over a whole drive, with ``labels`` labels in total, of which every tenth is a keyframe. The
    lead changes every ten frames."""
    count = len(drive.frames)
    life, by = min(_LIFE, count), Origin("import", "made up", 1)
    tracks = []
    for number in range(1, labels // life + 1):
        first = number * _FAR % (count - life + 1)
        sightings = tuple(
            Sighting(
                frame,
                Cuboid((5.0 + (number * 7 + frame) % 60, number * 3 % 25 - 12.0, 0.7), (4.0, 1.8, 1.5), 0.0),
                keyframe=frame % 10 == 0,
            )
            for frame in range(first, first + life)
        )
        tracks.append(LabelTrack(number, "car", sightings, "accepted", by))
    leads = tuple(
        LeadRange(frame, min(frame + 9, count - 1), tracks[frame // 10 % len(tracks)].id, "accepted", by)
        for frame in range(0, count, 10)
    )
    return LabelSet(drive.source, drive.frames, drive.t_ns, tuple(tracks), leads)


def _fill(address: str) -> int:
    """Import the synthetic labels as a file of one person. Returns the number of tracks; BadInput if the import
    fails."""
    with open_local(f"{address}/api/labels/export?format=native") as answer:
        labels = many(from_json(answer.read(), address))
    with open_local(f"{address}/api/labels") as answer:
        drive = json.load(answer)["drive"]["id"]
    query = urlencode({"format": "native", "person": _PERSON, "drive": drive})
    with open_local(Request(f"{address}/api/labels/import?{query}", to_json(labels), method="POST")) as answer:
        task = json.load(answer)["task"]
    deadline = time.monotonic() + _ALL_THERE_WITHIN_S
    while time.monotonic() < deadline:
        with open_local(f"{address}/api/state") as answer:
            now = json.load(answer)["labels"]["task"]
        if now is not None and now["id"] == task and not now["running"]:
            if now["error"]:
                raise BadInput(f"the labels were not imported: {now['error']}")
            return len(labels.tracks)
        time.sleep(_ASK_EVERY_S)
    raise BadInput(f"the labels were not imported within {_ALL_THERE_WITHIN_S:.0f} s")
