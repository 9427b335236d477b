"""/api/alignment: how well LiDAR and images match with the current parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite

from fastapi import APIRouter, HTTPException

from app.drive.alignment_scenes import AlignmentScenes
from app.engine.engine import Engine
from app.web.routes.shapes.common import ApiModel
from pipeline.calibration.edge_match import FEWEST, REACH_DEG, EdgeScore, Seen, edge_score
from pipeline.calibration.local_match import BANDS_M, LocalMatch, local_match
from pipeline.calibration.vehicle_match import with_vehicles

_NOTHING = "No frame has both an image and LiDAR points in it"


class RegionJson(ApiModel):
    """How well LiDAR and images agree in a part of the image."""

    borders: int
    """Depth edges that were compared."""
    score: float | None
    """1 when no shift of the points is better there, 0 when the usual shift is as good; null where it cannot tell."""
    shift_px: tuple[float, float] | None
    """By how many pixels of the image the points should move right and down; null where it cannot tell."""


class RangeJson(RegionJson):
    """The same by distance."""

    from_m: float
    """Nearest horizontal distance."""
    to_m: float | None
    """Farthest; null for the last one."""


class Score(ApiModel):
    """How well LiDAR and images agree."""

    score: float | None
    """1 when nothing near is better, 0 when the usual mount near is as good; null where nothing can be said."""
    sigmas: float | None
    """How far the best near stands out; null where too little is seen."""
    borders: int
    """Depth edges that were compared."""
    better: dict[str, float]
    """Changes of alignment parameters towards the best near; a factor for h_res_deg and v_res_deg."""
    brief: str
    """All of it in a word or two."""
    text: str
    """All of it in a sentence."""
    columns: int
    """Of the image's regions."""
    rows: int
    """Of the image's regions."""
    regions: list[RegionJson]
    """Parts of the image, row by row from the upper left."""
    ranges: list[RangeJson]
    """The same by distance."""


def alignment_router(engine: Engine, scenes: AlignmentScenes) -> APIRouter:
    """The score's route; the evaluated frames are determined once per recording."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])

    @router.get("/score")
    def score() -> Score:
        """Score the alignment of LiDAR and camera. Compares how well depth edges match image edges with the same
        for the mount rotated by up to 3°; where detectors have seen enough vehicles, these tell the pitch. Uses frames
        of the whole recording, which takes a second the first time; for live sensors, the frames shown at each request.
        404 when nothing is shown."""
        seen = seen_now(engine, scenes)
        params = engine.control.peek().params.alignment
        recording = engine.drives.recording
        vehicles = scenes.vehicles_of(recording) if recording is not None else []
        return _json(with_vehicles(edge_score(seen, params), vehicles, params), local_match(seen, params), len(seen))

    return router


def seen_now(engine: Engine, scenes: AlignmentScenes) -> list[Seen]:
    """The frames to score the current alignment with; 404 if nothing is shown."""
    recording, shown = engine.drives.recording, engine.snapshot
    if recording is not None:
        return scenes.of_recording(recording)
    if shown.processed is None or shown.uri is None:
        raise HTTPException(404, "nothing is shown yet")
    return scenes.of_shown(shown.uri, shown.processed.frame)


def _json(found: EdgeScore, local: LocalMatch, frames: int) -> Score:
    """frames: number of evaluated frames."""
    text = f"{_sentence(found)} ({found.borders} depth edges in {frames} frame{'' if frames == 1 else 's'})"
    return Score(
        score=found.score,
        sigmas=found.sigmas,
        borders=found.borders,
        better=dict(found.better),
        brief=_brief(found) if frames else "nothing to match",
        text=text if frames else _NOTHING,
        columns=local.columns,
        rows=local.rows,
        regions=[RegionJson(**asdict(each)) for each in local.grid],
        ranges=[
            RangeJson(from_m=low, to_m=high if isfinite(high) else None, **asdict(each))
            for low, high, each in zip(BANDS_M[:-1], BANDS_M[1:], local.bands, strict=True)
        ],
    )


def _brief(found: EdgeScore) -> str:
    if found.borders < FEWEST:
        return "too few edges"
    if found.score is None:
        return f"by vehicles: {_words(found.better)}" if found.better else "no clear best"
    return f"{100 * found.score:.0f} %" + (f" · better {_words(found.better)}" if found.better else "")


def _sentence(found: EdgeScore) -> str:
    if found.borders < FEWEST:
        return "Too few LiDAR depth edges in the images for a score"
    if found.score is None and found.better:
        return f"No mount rotation is clearly the best match of the edges; the vehicles ask for {_words(found.better)}"
    if found.score is None:
        return (
            f"No mount rotation within {REACH_DEG:.0f}° is clearly the best match; on a recording, Fit searches farther"
        )
    if found.better:
        return f"LiDAR and images match better with {_words(found.better)}"
    return f"No mount rotation within {REACH_DEG:.0f}° matches the image edges clearly better than the current one"


def _words(better: Mapping[str, float]) -> str:
    """As instructions for changing the parameters."""
    units = {"deg": "°", "px": " px"}
    if "h_res_deg" in better:
        return f"h_res and v_res × {better['h_res_deg']:g}"
    parts = [(name.rpartition("_"), by) for name, by in better.items()]
    return ", ".join(f"{name} {by:+g}{units[unit]}" for (name, _, unit), by in parts)
