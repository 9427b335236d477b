"""Line charts as inline SVG, in the page's own colours."""

from __future__ import annotations

from html import escape
from math import ceil, floor, log10

from pipeline.evaluation.report_sections import Chart, Series

WIDTH, HEIGHT = 560, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 54, 14, 14, 44
_DASHES = ("", "6 3", "2 3", "8 3 2 3")


def chart_svg(chart: Chart) -> str:
    """A figure with axes, one line per series and a legend below; an empty chart says that it has no data."""
    drawn = [line for line in chart.series if line.x]
    if not drawn:
        return f"<figure><figcaption>{escape(chart.title)}: no data</figcaption></figure>"
    x_ticks = ticks(min(min(line.x) for line in drawn), max(max(line.x) for line in drawn))
    y_ticks = ticks(min(0.0, min(min(line.y) for line in drawn)), max(max(line.y) for line in drawn))
    scale = _Scale(x_ticks, y_ticks)
    parts = [_grid(scale, chart.x_label, chart.y_label), *(_line(scale, line, n) for n, line in enumerate(drawn))]
    legend = "".join(
        f'<span class="key"><svg width="26" height="8">{_sample(line, n)}</svg>{escape(line.name)}</span>'
        for n, line in enumerate(drawn)
    )
    return (
        f"<figure><figcaption>{escape(chart.title)}</figcaption>"
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(chart.title)}">{"".join(parts)}</svg>'
        f'<div class="legend">{legend}</div></figure>'
    )


def ticks(low: float, high: float, about: int = 6) -> list[float]:
    """Round numbers that span low to high, in steps of 1, 2 or 5 times a power of ten."""
    size = max(abs(low), abs(high), 1.0)
    span = high - low if high - low > 1e-9 * size else size
    raw = span / about
    power = 10.0 ** floor(log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw)
    first = floor(low / step)
    last = max(ceil(high / step), first + 1)
    return [round(n * step, 12) for n in range(first, last + 1)]


class _Scale:
    """Maps values to pixels."""

    def __init__(self, x_ticks: list[float], y_ticks: list[float]) -> None:
        self.x_ticks, self.y_ticks = x_ticks, y_ticks

    def x(self, value: float) -> float:
        share = (value - self.x_ticks[0]) / (self.x_ticks[-1] - self.x_ticks[0])
        return _LEFT + share * (WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        share = (value - self.y_ticks[0]) / (self.y_ticks[-1] - self.y_ticks[0])
        return HEIGHT - _BOTTOM - share * (HEIGHT - _TOP - _BOTTOM)


def _grid(scale: _Scale, x_label: str, y_label: str) -> str:
    right, bottom = WIDTH - _RIGHT, HEIGHT - _BOTTOM
    lines = "".join(
        f'<line class="grid" x1="{_LEFT}" x2="{right}" y1="{scale.y(at):.1f}" y2="{scale.y(at):.1f}"/>'
        f'<text x="{_LEFT - 6}" y="{scale.y(at) + 4:.1f}" text-anchor="end">{at:g}</text>'
        for at in scale.y_ticks
    )
    marks = "".join(
        f'<line class="grid" x1="{scale.x(at):.1f}" x2="{scale.x(at):.1f}" y1="{_TOP}" y2="{bottom}"/>'
        f'<text x="{scale.x(at):.1f}" y="{bottom + 16}" text-anchor="middle">{at:g}</text>'
        for at in scale.x_ticks
    )
    upright = f"translate(13 {(_TOP + bottom) / 2}) rotate(-90)"
    names = (
        f'<text x="{(_LEFT + right) / 2}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x_label)}</text>'
        f'<text transform="{upright}" text-anchor="middle">{escape(y_label)}</text>'
    )
    return lines + marks + names


def _line(scale: _Scale, line: Series, index: int) -> str:
    points = [(scale.x(x), scale.y(y)) for x, y in zip(line.x, line.y, strict=True)]
    if line.points_only or len(points) == 1:  # a line with one point draws nothing
        radius = 2 if line.points_only else 4
        return "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" class="fill{index % 6}"/>' for x, y in points)
    return f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" {_stroke(index)}/>'


def _sample(line: Series, index: int) -> str:
    """The legend's sample of a line."""
    if line.points_only or len(line.x) == 1:
        return f'<circle cx="13" cy="4" r="2.5" class="fill{index % 6}"/>'
    return f'<line x1="0" y1="4" x2="26" y2="4" {_stroke(index)}/>'


def _stroke(index: int) -> str:
    return f'class="line{index % 6}" fill="none" stroke-width="2" stroke-dasharray="{_DASHES[index % len(_DASHES)]}"'
