"""Saves the drives behind an experiment's figures so that they can be opened again: for each drive a scenario file with
the ego motion as driven, the parameters, and a page with its curves, and an index page. Files use relative paths only,
so the folder can be moved together with its report."""

from __future__ import annotations

import json
import os
from html import escape
from pathlib import Path
from shlex import quote
from typing import Any
from urllib.parse import quote as url_quote
from urllib.parse import urlencode

from app.core.server_address import DEFAULT_PORT
from app.reports.html import page, section_html
from app.reports.svg_charts import chart_svg
from pipeline.evaluation.report_sections import Linked, ReportSection, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.params import Params, changes_of
from pipeline.params import to_yaml as params_to_yaml
from pipeline.simulation.drive_as_scenario import to_yaml

_BY_NETWORK = (
    "The embedded network detected vehicles in the rendered images, as it does here, but no lane lines. A dashboard "
    "that detects lane lines may estimate another path."
)
_LINK = """<p id="open" hidden>If a dashboard is open on this machine, <a href="">open the drive there</a> with the
parameters it was driven with.</p>
<script>
if (location.protocol === "file:") {
  const folder = decodeURIComponent(location.pathname).replace(/[^/]*$/, ""), line = document.getElementById("open");
  line.firstElementChild.href = `DASHBOARD/#uri=${encodeURIComponent("sim:" + folder + FILE)}&QUERY`;
  line.hidden = false;
}
</script>"""
"""A script makes the link, because the path of the folder is known only once the page is open."""


class ReplayFolder:
    """The folder for the drives of one run of experiments. OSError if it cannot be created or written to."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._kept: dict[str, tuple[str, list[ExperimentDrive]]] = {}

    def keep(self, experiment: Experiment[Any, Any], drive: ExperimentDrive) -> None:
        """Write the drive's three files."""
        self._kept.setdefault(experiment.name, (experiment.title, []))[1].append(drive)
        heading = f"{drive.title}\n{_command(drive)}"
        self._path(drive, ".yaml").write_text(to_yaml(drive.as_seen(), heading), encoding="utf-8")
        self._path(drive, ".params.yaml").write_text(params_to_yaml(drive.params), encoding="utf-8")
        self._path(drive, ".html").write_text(_page(drive), encoding="utf-8")

    def list_all(self) -> str:
        """Write ``index.html``, which links to every drive. Returns a sentence that says where it is."""
        body = "".join(section_html(_listed(name, title, drives)) for name, (title, drives) in self._kept.items())
        index = self._folder / "index.html"
        index.write_text(page("Drives", body), encoding="utf-8")
        count = sum(len(drives) for _, drives in self._kept.values())
        return f"{count} drive{'s' if count != 1 else ''} saved: {index}"

    def link_from(self, report: Path) -> str:
        """Relative address of this folder for links in a report, ending in a slash."""
        between = os.path.relpath(self._folder.resolve(), report.resolve().parent)
        return f"{url_quote(Path(between).as_posix())}/"

    def _path(self, drive: ExperimentDrive, suffix: str) -> Path:
        return self._folder / f"{drive.name}{suffix}"


def _listed(name: str, title: str, drives: list[ExperimentDrive]) -> ReportSection:
    rows = tuple((Linked(each.title, url_quote(f"{each.name}.html")), " ".join(each.text)) for each in drives)
    return ReportSection(name, title, tables=(Table(f"{len(drives)} drives", ("drive", "outcome"), rows),))


def _command(drive: ExperimentDrive) -> str:
    """The command that opens the drive, to be run in the folder."""
    lanes = "" if drive.detections is not None else " --lanes off"
    return f"cipv serve {quote(f'sim:{drive.name}.yaml')} --params {quote(f'{drive.name}.params.yaml')}{lanes}"


def _page(drive: ExperimentDrive) -> str:
    text = [*drive.text, *([_BY_NETWORK] if drive.detections is None else [])]
    body = (
        "".join(f"<p>{escape(each)}</p>" for each in text)
        + f'<div class="charts">{"".join(map(chart_svg, drive.charts))}</div>'
        + f"<h3>See it</h3><p>In this folder: <code>{escape(_command(drive))}</code></p>"
        + _link(drive)
    )
    return page(drive.title, body)


def _link(drive: ExperimentDrive) -> str:
    """A link to the drive in a running dashboard, as made by *Share*."""
    changed = {name: now for name, (_, now) in changes_of(Params(), drive.params).items()}
    query = urlencode({"preset": "default", "params": json.dumps(changed)}, quote_via=url_quote)
    return (
        _LINK.replace("DASHBOARD", f"http://127.0.0.1:{DEFAULT_PORT}")
        .replace("FILE", json.dumps(f"{drive.name}.yaml"))
        .replace("QUERY", query)
    )
