"""A parameter is added in one place: its declaration."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

_WITH_A_NEW_LINE = """
import contextlib, importlib.machinery, io, json, pathlib, sys

LINE = '    brand_new: float = slider(0.5, 0.0, 1.0, 0.1, "m", "What nobody has declared before")\\n'
MODULE, BEFORE = "pipeline.params.lidar", "    tolerance_m: float"
plain = importlib.machinery.SourceFileLoader.get_code

def with_the_line(loader, name):
    if name != MODULE:
        return plain(loader, name)
    text = pathlib.Path(loader.path).read_text(encoding="utf-8")
    assert BEFORE in text
    return compile(text.replace(BEFORE, LINE + BEFORE), loader.path, "exec")

importlib.machinery.SourceFileLoader.get_code = with_the_line

from app.commands.params import ListParams
from app.commands.support.options import PipelineOptions
from app.web.routes.params import describe
from pipeline.params import Params, from_yaml, to_yaml, with_changes

def printed(command):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert command() == 0
    return out.getvalue()

file = pathlib.Path(sys.argv[1])
changed = PipelineOptions(set=("cluster.brand_new=0.8",))
file.write_text(printed(ListParams(pipeline=changed, yaml=True)), encoding="utf-8")
clusters = next(section for section in describe() if section["name"] == "cluster")
print(json.dumps({
    "schema": Params.model_json_schema()["$defs"]["ClusterParams"]["properties"]["brand_new"],
    "page": clusters["params"][0],
    "listed": "brand_new" in printed(ListParams()),
    "set": changed.parameters().cluster.brand_new,
    "file": from_yaml(file, Params()).cluster.brand_new,
    "default": Params().cluster.brand_new,
}))
"""


def test_one_new_line_is_in_the_schema_the_page_the_command_line_and_preset_files(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _WITH_A_NEW_LINE, str(tmp_path / "mine.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["schema"]["description"] == "What nobody has declared before"
    assert (found["schema"]["minimum"], found["schema"]["maximum"], found["schema"]["step"]) == (0.0, 1.0, 0.1)
    assert found["page"]["key"] == "brand_new"
    assert found["listed"]
    assert (found["default"], found["set"], found["file"]) == (0.5, 0.8, 0.8)
