"""The accuracy table that README quotes, written to build/accuracy.md."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.alignment.projection import Alignment, angular_from_calibration, resolve
from pipeline.evaluation.lead_verdict import LeadScore, score
from pipeline.params import Params
from pipeline.run import Sensors
from tests.accuracy.drives import all_scored, camera_alone_without_own_clip, drive, made_up_leads, opened
from tests.conftest import ROOT

LANES = "twinlitenet"
"""The lane network that the command line uses if it is installed."""
BEST = "**default, both sensors**"
ROWS: tuple[tuple[str, str, Sensors, str, tuple[tuple[str, object], ...]], ...] = (
    (BEST, "default", "both", LANES, ()),
    ("default, LiDAR alone", "default", "lidar", LANES, ()),
    ("default, camera alone", "default", "camera", LANES, ()),
    ("default, both, `--lanes classical`", "default", "both", "classical", ()),
    ("default, both, `--lanes off`", "default", "both", "off", ()),
    ("default, camera alone, `--lanes off`", "default", "camera", "off", ()),
    ("default, both, `angular` alignment", "default", "both", LANES, (("alignment.model", "angular"),)),
    ("paper, both sensors", "paper", "both", LANES, ()),
    ("paper, LiDAR alone", "paper", "lidar", LANES, ()),
    ("paper, camera alone", "paper", "camera", LANES, ()),
)


def test_the_table_is_written(data_dir: Path) -> None:
    drives = {
        name: drive(data_dir, "astyx", preset, sensors, changes, lanes)
        for name, preset, sensors, lanes, changes in ROWS
    }
    scores = {name: score(all_scored(each)) for name, each in drives.items()}
    made_up = {name: made_up_leads(each) for name, each in drives.items()}
    scores["default, camera alone, distance law of the other clips"] = score(camera_alone_without_own_clip(data_dir))
    text = "\n".join([*_table(scores, made_up), "", *_alignment_cost(data_dir)]) + "\n"
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / "accuracy.md").write_text(text, encoding="utf-8")
    print("\n" + text)
    assert all(total.frames == 31 for total in scores.values())
    assert scores[BEST].correct == max(total.correct for total in scores.values())
    assert made_up[BEST] == 0


def _table(scores: dict[str, LeadScore], made_up: dict[str, int]) -> Iterator[str]:
    yield "| | correct | missed | wrong | mean error | largest | relative | false leads |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, total in scores.items():
        mean, most, share = total.mean_error_m, total.max_error_m, total.mean_relative_error
        assert mean is not None
        assert most is not None
        assert share is not None
        counts = f"{total.correct} | {total.missed} | {total.wrong}"
        yield f"| {name} | {counts} | {mean:.2f} m | {most:.2f} m | {100 * share:.1f} % | {made_up.get(name, '')} |"


def _alignment_cost(data_dir: Path) -> Iterator[str]:
    """Pixels between the paper's angular model, set from the calibration at the image's centre, and the calibrated
    pinhole, over all LiDAR points that fall into the image, by their bearing."""
    yield "| bearing | Astyx, f = 1818 px | KITTI, f = 721 px |"
    yield "|---|---|---|"
    columns = [_by_bearing(opened(f"{kind}:{data_dir / name}")) for kind, name in _CALIBRATED]
    for low, high in _BEARINGS_DEG:
        cells = [f"{column[low]:.0f} px" if column[low] is not None else "outside" for column in columns]
        yield f"| {low}–{high}° | {' | '.join(cells)} |"


_CALIBRATED = (("astyx", "astyx"), ("kitti", "kitti_0052"))
_BEARINGS_DEG = ((0, 5), (5, 10), (10, 20), (20, 30), (30, 40))


def _by_bearing(source: object) -> dict[int, float | None]:
    """Median distance in pixels between the two models, by the lower end of the bearing's bin."""
    frame = source.frame(7)  # type: ignore[attr-defined]
    exact: Alignment | None = resolve(Params().alignment, frame.camera)
    assert exact is not None
    points = frame.sweep.points[:, :3].astype(np.float64)
    pixels = exact.project(points)
    seen = np.all((pixels >= 0) & (pixels < [frame.camera.width, frame.camera.height]), axis=1)
    apart = np.hypot(*(angular_from_calibration(frame.camera).project(points) - pixels).T)
    bearing = np.abs(np.degrees(np.arctan2(points[:, 1], points[:, 0])))
    bins = {}
    for low, high in _BEARINGS_DEG:
        inside = seen & (bearing >= low) & (bearing < high)
        bins[low] = float(np.median(apart[inside])) if inside.sum() >= 20 else None
    return bins
