"""A report of experiments or scores as one HTML file: scenes, tables and charts, in the reader's light or dark theme.
It loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from app.reports.scene_images import scene_html
from app.reports.svg_charts import chart_svg
from pipeline.evaluation.report_sections import AnyCell, Cell, Coloured, Driven, Linked, ReportSection, Scene, Table

_STYLE = """
:root { color-scheme: light dark; --ground: #fff; --ink: #1b2024; --soft: #5d6870; --edge: #d8dee2; --raised: #f4f6f7;
  --c0: #0b6bcb; --c1: #c2410c; --c2: #15803d; --c3: #9333ea; --c4: #0e7490; --c5: #be123c; }
@media (prefers-color-scheme: dark) { :root { --ground: #14181b; --ink: #e6eaed; --soft: #98a4ad; --edge: #30383e;
  --raised: #1c2226; --c0: #6cb4ff; --c1: #ff9d6b; --c2: #6fd08c; --c3: #c99bff; --c4: #5fcfe0; --c5: #ff8fa3; } }
body { font: 15px/1.5 system-ui, sans-serif; background: var(--ground); color: var(--ink); max-width: 1180px;
  margin: 0 auto; padding: 24px; }
h1 { font-size: 24px; } h2 { font-size: 19px; margin-top: 44px; border-bottom: 1px solid var(--edge); }
h3 { font-size: 15px; margin: 22px 0 6px; } p { max-width: 80ch; } nav a { margin-right: 14px; } a { color: var(--c0); }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13.5px; }
th, td { padding: 3px 10px; border-bottom: 1px solid var(--edge); text-align: right; white-space: nowrap; }
th { background: var(--raised); font-weight: 600; } td.word, th.word { text-align: left; }
caption, .note { caption-side: bottom; text-align: left; color: var(--soft); font-size: 13px; padding-top: 4px; }
.scenes { display: grid; grid-template-columns: repeat(auto-fill, minmax(340px, 1fr)); gap: 14px; }
.scene img { display: block; width: 100%; margin-top: 4px; } .plan { display: block; background: var(--raised); }
.tarmac { fill: #8a949b; } .paint { fill: none; stroke: #fff; stroke-width: 0.15; } .mark { stroke: var(--soft);
  stroke-width: 0.2; } .plan text { font-size: 2.6px; } .car { stroke: #14181b; stroke-width: 0.25; }
.car.ego { fill: #0b6bcb; } .way { fill: none; stroke: #f5d90a; stroke-width: 0.45; stroke-dasharray: 1.2 0.8; }
.way.ego { stroke: #0b6bcb; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(420px, 1fr)); gap: 18px; }
figure { margin: 12px 0; } figcaption { font-weight: 600; font-size: 13.5px; } figure > svg { width: 100%; }
svg text { fill: var(--soft); font-size: 11px; } .grid { stroke: var(--edge); } .legend { font-size: 12px; }
.key { margin-right: 14px; white-space: nowrap; } .key svg { margin-right: 5px; }
.line0 { stroke: var(--c0); } .line1 { stroke: var(--c1); } .line2 { stroke: var(--c2); } .line3 { stroke: var(--c3); }
.line4 { stroke: var(--c4); } .line5 { stroke: var(--c5); }
.fill0 { fill: var(--c0); } .fill1 { fill: var(--c1); } .fill2 { fill: var(--c2); } .fill3 { fill: var(--c3); }
.fill4 { fill: var(--c4); } .fill5 { fill: var(--c5); }
.green { background: #2e9e4f; color: #fff; } .yellow { background: #f5d90a; color: #222; }
.orange { background: #ef8b17; color: #222; } .brown { background: #8d5524; color: #fff; }
td a { color: inherit; text-decoration-style: dotted; } code { font-size: 13px; }
.red { background: #c62828; color: #fff; } .grey { background: #8a949b; color: #fff; }
"""


def html(sections: Iterable[ReportSection], title: str, folder: str = "") -> str:
    """The whole report. folder: relative address of the folder with the saved drives; empty without one."""
    sections = list(sections)
    links = "".join(f'<a href="#{escape(each.name)}">{escape(each.name)}</a>' for each in sections)
    return page(title, f"<nav>{links}</nav>{''.join(section_html(each, folder) for each in sections)}")


def page(title: str, body: str) -> str:
    """An HTML file that loads nothing."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>"
        f"<body><h1>{escape(title)}</h1>{body}</body></html>\n"
    )


def section_html(section: ReportSection, folder: str = "") -> str:
    """One section, to be embedded in another page."""
    return (
        f'<section id="{escape(section.name)}"><h2>{escape(section.title)}</h2>'
        + "".join(f"<p>{escape(paragraph)}</p>" for paragraph in section.text)
        + (f'<p><a href="{escape(folder)}index.html#{escape(section.name)}">Every drive</a></p>' if folder else "")
        + _scenes(section.scenes)
        + "".join(_table(table, folder) for table in section.tables)
        + f'<div class="charts">{"".join(chart_svg(chart) for chart in section.charts)}</div></section>'
    )


def _scenes(scenes: Iterable[Scene]) -> str:
    drawn = "".join(map(scene_html, scenes))
    return f'<div class="scenes">{drawn}</div>' if drawn else ""


def _table(table: Table, folder: str) -> str:
    worded = [all(isinstance(row[n], str | Linked | None) for row in table.rows) for n in range(len(table.columns))]
    head = "".join(
        f'<th class="{"word" if words else ""}">{escape(name)}</th>'
        for name, words in zip(table.columns, worded, strict=True)
    )
    rows = "".join(f"<tr>{''.join(_cell(cell, table.decimals, folder) for cell in row)}</tr>" for row in table.rows)
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    return f'<h3>{escape(table.title)}</h3><div class="wide"><table>{caption}<tr>{head}</tr>{rows}</table></div>'


def _cell(cell: AnyCell, decimals: int, folder: str) -> str:
    if isinstance(cell, Linked):
        return f'<td class="word"><a href="{escape(cell.href)}">{escape(in_words(cell.value, decimals))}</a></td>'
    value = cell.value if isinstance(cell, Coloured | Driven) else cell
    tone = cell.tone if isinstance(cell, Coloured) else ""
    drive = cell.drive if isinstance(cell, Coloured | Driven) else ""
    kind = "word" if isinstance(value, str) and not tone else tone
    text = escape(in_words(value, decimals))
    if drive and folder:
        text = f'<a href="{escape(folder + drive)}.html" title="Open this drive">{text}</a>'
    return f'<td class="{kind}">{text}</td>'


def in_words(value: Cell, decimals: int) -> str:
    """A cell as text: a dash for None, no decimals for whole numbers."""
    if value is None:
        return "–"
    return f"{value:.{decimals}f}" if isinstance(value, float) else str(value)
