/** Table of metrics of the compared and the shown run, coloured by improvement. */
import { el } from "../core/dom.js";
import { DASH, num, signed } from "../core/format.js";

/** @typedef {import("../drive/types.js").Metric} Metric */

const JUDGES = {
  labels: "labels made here",
  recording: "labels of the recording",
  simulator: "simulator ground truth",
};

/**
 * @param {Pick<import("../drive/types.js").Comparison, "metrics"|"truth"|"judged">} comparison
 * @param {boolean} [isAlone] a single column, without comparison
 * @returns {HTMLElement}
 */
export function metricsTable({ metrics, truth, judged }, isAlone = false) {
  const judge = truth
    ? `Evaluated on ${judged} ${judged === 1 ? "frame" : "frames"} against ${JUDGES[truth]}`
    : "No labels: only metrics that need none";
  const head = (isAlone ? [] : ["", "compared", "shown", "change"]).map((words) =>
    el("th", { scope: "col", textContent: words }),
  );
  return el(
    "div",
    {},
    el(
      "table",
      { class: "metrics" },
      el("thead", {}, el("tr", {}, ...head)),
      el("tbody", {}, ...metrics.map((metric) => row(metric, isAlone))),
    ),
    el("p", { class: "facts", textContent: judge }),
  );
}

/** @param {Metric} metric @param {boolean} isAlone */
function row(metric, isAlone) {
  const { name, unit, base, run } = metric;
  const digits = [base, run].every((value) => value === null || Number.isInteger(value)) ? 0 : 2;
  const change = base === null || run === null ? null : Number((run - base).toFixed(digits)); // as it is shown
  const title = el("th", { scope: "row", textContent: unit ? `${name}, ${unit}` : name });
  if (isAlone) return el("tr", {}, title, el("td", { textContent: num(run, digits) }));
  return el(
    "tr",
    { data: { change: verdict(metric, change) } },
    title,
    el("td", { textContent: num(base, digits) }),
    el("td", { textContent: num(run, digits) }),
    el("td", { textContent: change === null ? DASH : change === 0 ? "=" : signed(change, digits) }),
  );
}

/** @param {Metric} metric @param {number|null} change */
function verdict({ better }, change) {
  if (!better || !change) return "same";
  return change > 0 === (better === "higher") ? "better" : "worse";
}
