"""`cipv params`: list every parameter with its value, unit and meaning."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

from rich.console import Console
from rich.table import Table

from app.commands.support.options import PipelineOptions
from pipeline.params import Params, to_yaml


@dataclass(frozen=True)
class ListParams:
    """List every parameter, or print a preset file for `cipv run --params`.

    Example: cipv params --preset paper --yaml > mine.yaml
    """

    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    json: bool = False
    """Print the JSON schema"""
    yaml: bool = False
    """Print the values as a preset file"""

    def __call__(self) -> int:
        params = self.pipeline.parameters()
        if self.json:
            print(json.dumps(Params.model_json_schema(), indent=1, ensure_ascii=False))
        elif self.yaml:
            print(to_yaml(params), end="")
        else:
            Console().print(_table(params))
        return 0


def _table(params: Params) -> Table:
    table = Table("parameter", "value", "unit", "meaning", title="Parameters", header_style="bold")
    for section_name in Params.model_fields:
        section = getattr(params, section_name)
        for name, info in type(section).model_fields.items():
            extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
            value = getattr(section, name)
            shown = "from the calibration" if value is None else str(value)
            table.add_row(f"{section_name}.{name}", shown, str(extra.get("unit", "")), info.description or "")
    return table
