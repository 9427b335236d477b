"""In which order a frame's objects could have led, and what stopped each."""

from __future__ import annotations

from pathlib import Path

from app.streaming.ranking import BEHIND, ranking, ranking_json
from pipeline.detection import Detectors, detector_for
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.types import Cipv, Gate, Rejection, Result
from tests.app.engine.recording_helpers import CountingDetector, Recording


def result_of(**changes) -> Result:
    results = run(Recording(count=1), Params(), Detectors(CountingDetector()))
    _, result = next(results)
    return Result(**{**vars(result), **changes})


def with_objects() -> Result:
    """#1 is the lead at 20 m, #2 behind it passed every test, #3 and #4 failed one, #3 is nearer."""
    base = result_of()
    item = base.objects[0]
    ok = Gate("hits", 5, 3, True)
    alone = Gate("iou", 0.0, 0.1, False)  # of fusion: it stops nobody from leading
    rows = [
        (4, 9.0, (ok, Gate("size", 0.2, 0.5, False), Gate("seen", 0.0, 1.0, False))),
        (3, 5.0, (ok, Gate("path_offset", 3.0, 1.5, False))),
        (2, 40.0, (alone, ok)),
        (1, 20.0, (alone, ok)),
    ]
    objects = tuple(type(item)(**{**vars(item), "id": n, "distance_m": d, "gates": gates}) for n, d, gates in rows)
    rejected = (Rejection(2, "behind #1"), Rejection(3, "out of path by 1.5 m"), Rejection(4, "only 0.2 m wide"))
    return result_of(objects=objects, cipv=Cipv(1, 20.0, None, None, "car, alone"), rejected=rejected)


def test_the_lead_first_then_who_came_second_then_who_was_stopped():
    ranked = ranking(with_objects())
    assert [(each.id, each.order, each.stopped_by) for each in ranked] == [
        (1, 1, None),
        (2, 2, BEHIND),
        (3, 3, "path_offset"),
        (4, 4, "size"),
    ]
    assert [each.reason for each in ranked][:2] == ["car, alone", "behind #1"]
    assert (ranked[2].value, ranked[2].limit) == (3.0, 1.5)


def test_a_limit_that_is_not_finite_is_null_for_the_page():
    result = with_objects()
    item = result.objects[0]
    endless = type(item)(**{**vars(item), "gates": (Gate("path_reach", 3.0, float("inf"), False),)})
    assert ranking_json(result_of(objects=(endless,), cipv=None, rejected=()))[0]["limit"] is None


def test_on_a_real_frame_everything_that_does_not_lead_has_a_reason(data_dir: Path):
    source = open_source(f"kitti:{data_dir / 'kitti_0052'}")
    detector = detector_for(source, str(data_dir / "models" / "yolox_nano.onnx"))
    for index, (_, result) in enumerate(run(source, Params(), Detectors(detector))):
        ranked = ranking(result)
        assert len(ranked) == len(result.objects) == len({each.id for each in ranked})
        assert result.cipv is not None
        assert ranked[0].id == result.cipv.id
        assert all(each.stopped_by and each.reason for each in ranked[1:])
        if index == 3:
            break
