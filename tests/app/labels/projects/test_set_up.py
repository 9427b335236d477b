"""A project from its file: real recordings, their sample in the queue, classes, control frames and progress."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest
import yaml

from app.labels.projects.progress import progress
from app.labels.projects.project_file import read_project
from app.labels.projects.results import ProjectProgress
from app.labels.projects.set_up import set_up
from app.labels.service.next_work import Asked, where_next
from app.labels.service.scoring import LabelScores
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels, info_of
from app.labels.store.work import queue
from pipeline.common.errors import BadInput
from pipeline.labels.formats.native import to_json
from pipeline.labels.model import FrameTag, LabelSet, LeadRange, Origin
from pipeline.sources import open_source
from tests.app.labels.acts.doing import act

DRIVE = "sim:straight"
CLASSES = "classes: {car: {}, tank: {of: car}}\n"


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> DriveLabels:
    """The recording, in its own database."""
    source = open_source(DRIVE)
    count = len(source)
    database = Database.in_file(tmp_path_factory.mktemp("projects") / "labels.db")
    return DriveLabels(database, info_of(source, lambda: tuple(map(str, range(count)))))


def put(there: DriveLabels, folder: Path, **entries: object) -> ProjectProgress:
    (folder / "classes.yaml").write_text(CLASSES)
    file = folder / "project.yaml"
    file.write_text(yaml.safe_dump({"name": "Winter", "drives": [DRIVE]} | entries))
    list(set_up(there._database, read_project(file), "Eve"))
    (found,) = progress(there._database)
    return found


def test_a_sample_is_in_the_queue_until_it_is_labelled_and_a_new_one_keeps_what_is(
    there: DriveLabels, tmp_path: Path
) -> None:
    seconds = (there.info.t_ns[-1] - there.info.t_ns[0]) // 1_000_000_000
    made = put(there, tmp_path, sampling={"every_s": 1})
    assert (made.drives, made.sampled, made.asked) == (1, seconds + 1, seconds + 1)
    assert made.sampling == "one frame every 1 s"
    (work,) = queue(there._database)
    assert (work.project, work.sampled) == ("Winter", seconds + 1)
    place, why, _ = where_next(there, LabelScores(), None, Asked("asked", 0, 1))
    assert place is not None
    assert (place.frame, why) == (10, "queued: Winter: one frame every 1 s")
    act(there, "Ada", kind="set_lead", first=0, last=10, lead="none")
    (now,) = progress(there._database)
    assert (now.sampled, now.asked) == (seconds + 1, seconds - 1)
    assert {each.person: each.acts for each in now.people} == {"Eve": 1, "Ada": 1}
    again = put(there, tmp_path, sampling={"random": 3, "seed": 1})
    assert again.sampled - again.asked >= 2, "both labelled frames stay"
    assert again.asked <= 3, "the others of the old sample do not"


def test_a_project_has_its_own_classes_and_its_control_frames_look_like_others(
    there: DriveLabels, tmp_path: Path
) -> None:
    sure = Origin("import", "truth", 1)
    truth = LabelSet("x", there.info.names(), there.info.t_ns, leads=(LeadRange(20, 29, "none", "accepted", sure),))
    (tmp_path / "truth.json").write_bytes(to_json(truth))
    control = [{"drive": DRIVE, "first": 21, "last": 30, "truth": "truth.json"}]
    put(there, tmp_path, classes="classes.yaml", sampling={"every_s": 2}, control=control)
    known = there.classes()
    assert known is not None
    assert (list(known.classes), known.base("tank")) == (["car", "tank"], "car")
    frames = tags_of(there)
    assert {20, 40} <= frames.keys()
    assert {*range(21, 30)}.isdisjoint(frames), "a run of frames would give them away"
    assert frames[20] == frames[40]


def tags_of(there: DriveLabels) -> dict[int, Origin]:
    """Who queued each frame."""
    tags = [cast("FrameTag", item.value) for item in there.items("tag").values()]
    return {n: each.origin for each in tags for n in range(each.first, each.last + 1)}


WRONG = {
    "no rule": ({"sampling": {}}, "give one of every_s, random and worth"),
    "a colon": ({"name": "a: b"}, "name"),
    "another drive": ({"control": [{"drive": "sim:curve", "truth": "truth.json"}]}, "not among the drives"),
    "no file": ({"control": [{"drive": DRIVE, "truth": "nowhere.json"}]}, "nowhere.json"),
    "an unknown setting": ({"sample": 3}, "no such setting; did you mean sampling"),
    "a drive that is not there": ({"drives": ["kitti:/nowhere"]}, "nowhere"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_in_a_sentence_and_nothing_is_stored(
    there: DriveLabels, tmp_path: Path, name: str
) -> None:
    entries, says = WRONG[name]
    before = progress(there._database)
    with pytest.raises(BadInput, match=says):
        put(there, tmp_path, **entries)
    assert progress(there._database) == before
