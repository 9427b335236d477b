"""The drives behind an experiment's figures, kept so that they can be seen again: for each a scenario file with the ego
vehicle as driven, the parameters it drove with, and a page with its curves."""

from __future__ import annotations

from html import escape
from pathlib import Path
from shlex import quote
from urllib.parse import quote as url_quote

from app.report import page
from app.server import DEFAULT_PORT
from app.svg import chart_svg
from pipeline.evaluation.experiments.sections import Replay
from pipeline.params import to_yaml as params_to_yaml
from pipeline.simulation.replay import to_yaml

_BOXES = {
    "truth": "In the loop the camera's boxes were projected truth with a detector's errors; here a network looks at "
    "pictures drawn of the same moments, so what it finds may differ.",
    "network": "In the loop the embedded network looked at the drawn pictures, as it does here.",
}


class ReplayFolder:
    """Where the drives of one run of experiments go. OSError when the folder cannot be made or written to."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder.resolve()

    def keep(self, replay: Replay) -> None:
        """Write the drive's three files."""
        scenario, params = self._path(replay, ".yaml"), self._path(replay, ".params.yaml")
        command = f"cipv serve {quote(f'sim:{scenario}')} --params {quote(str(params))} --sensors {replay.sensors}"
        scenario.write_text(to_yaml(replay.scenario, f"{replay.title}\n{command}"), encoding="utf-8")
        params.write_text(params_to_yaml(replay.params), encoding="utf-8")
        self._path(replay, ".html").write_text(_page(replay, scenario, command), encoding="utf-8")

    def link_from(self, report: Path) -> str:
        """What leads from a report to this folder, ending in a slash; absolute where they share no folder above."""
        try:
            between = self._folder.relative_to(report.resolve().parent).as_posix()
        except ValueError:
            return self._folder.as_uri() + "/"
        return f"{url_quote(between)}/"

    def _path(self, replay: Replay, suffix: str) -> Path:
        return self._folder / f"{replay.name}{suffix}"


def _page(replay: Replay, scenario: Path, command: str) -> str:
    text = [*replay.text, *([_BOXES[replay.boxes]] if replay.sensors != "lidar" else [])]
    address = f"http://127.0.0.1:{DEFAULT_PORT}/#uri={url_quote(f'sim:{scenario}')}"
    body = (
        "".join(f"<p>{escape(each)}</p>" for each in text)
        + f'<div class="charts">{"".join(map(chart_svg, replay.charts))}</div>'
        + f"<h3>See it</h3><p>With the parameters it drove with: <code>{escape(command)}</code></p>"
        + f'<p>In a dashboard that is open already: <a href="{escape(address)}">{escape(address)}</a></p>'
    )
    return page(replay.title, body)
