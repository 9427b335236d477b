"""The table of metrics before and after."""

from __future__ import annotations

from tests.browser.conftest import OpenPage

ROWS = """async () => {
  const { metricsTable } = await import("/js/panels/metrics_table.js");
  const metrics = [[0.0701, 0.0699], [0.07, 0.05], [39, 38]].map(([base, run]) =>
    ({ name: "error", unit: "m", base, run, better: "lower" }));
  const table = metricsTable({ metrics, truth: "labels", judged: 39 });
  return [...table.querySelectorAll("tbody tr")].map((row) => [row.lastChild.textContent, row.dataset.change]);
}"""


def test_a_change_that_rounds_to_nothing_is_no_improvement(open_page: OpenPage) -> None:
    page = open_page()
    assert page.evaluate(ROWS) == [["=", "same"], ["−0.02", "better"], ["−1", "better"]]
