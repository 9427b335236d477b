/** Histograms and counts of the Fleet view; clicking or dragging them sets a filter. */
import { el, press } from "../core/dom.js";

/** @typedef {import("./filters.js").Range} Range */

/**
 * Kinds of event with their counts, and named conditions, as buttons.
 * @param {HTMLElement} parent
 * @param {{kinds: string[], named: Record<string, string>}} fleet
 * @param {{value: string|null, count: number}[]} counts of events; none: other tables have no kinds
 * @param {(kind: string) => void} onKind @param {(name: string) => void} onNamed
 * @param {{kinds: Set<string>, named: Set<string>}} chosen
 */
export function showKinds(parent, fleet, counts, onKind, onNamed, chosen) {
  const count = new Map(counts.map(({ value, count }) => [value, count]));
  const kinds = fleet.kinds.filter((kind) => count.has(kind) || chosen.kinds.has(kind));
  const buttons = kinds.map((kind) => {
    const words = `${kind.replaceAll("_", " ")} ${(count.get(kind) ?? 0).toLocaleString("en")}`;
    return chip(words, chosen.kinds.has(kind), "", () => onKind(kind));
  });
  const named = Object.entries(fleet.named).map(([name, sql]) =>
    chip(name, chosen.named.has(name), sql, () => onNamed(name)),
  );
  parent.replaceChildren(...buttons, ...(buttons.length ? [el("i", { class: "fleet-gap" })] : []), ...named);
}

/** @param {string} words @param {boolean} isOn @param {string} title @param {() => void} act */
function chip(words, isOn, title, act) {
  const button = el("button", { type: "button", textContent: words, title, onclick: act });
  press(button, isOn);
  return button;
}

/**
 * A histogram of a column. Dragging over bars, or filling in the fields below, sets a range.
 * @param {import("./filters.js").Chart} chart
 * @param {{edges: number[], counts: number[]}} found
 * @param {Range} chosen
 * @param {(range: Range) => void} onRange
 */
export function histogram(chart, found, chosen, onRange) {
  const { edges, counts } = found,
    highest = Math.max(...counts, 1);
  const isInside = (/** @type {number} */ n) =>
    (chosen[0] === null || edges[n + 1] > chosen[0]) && (chosen[1] === null || edges[n] < chosen[1]);
  const bars = counts.map((count, n) =>
    el("i", {
      style: { "--part": `${(100 * count) / highest}%` },
      data: { inside: String(isInside(n)) },
      title: `${number(edges[n])} – ${number(edges[n + 1])} ${chart.unit}: ${count.toLocaleString("en")}`,
    }),
  );
  const plot = el("div", { class: "fleet-bars" }, ...bars);
  if (counts.length) dragging(plot, edges, onRange);
  else plot.append(el("span", { class: "facts", textContent: "no values" }));
  const fields = ["from", "to"].map((word, place) => {
    const edge = edges.length ? number(edges[place ? edges.length - 1 : 0]) : "";
    const field = el("input", {
      type: "number",
      step: "any",
      value: chosen[place] === null ? "" : String(chosen[place]),
      placeholder: edge,
      aria: { label: `${chart.title} ${word}` },
    });
    field.addEventListener("change", () => {
      /** @type {Range} */
      const range = [...chosen];
      range[place] = field.value === "" ? null : field.valueAsNumber;
      onRange(range);
    });
    return field;
  });
  const unit = chart.unit ? ` (${chart.unit})` : "";
  return el(
    "section",
    { class: "fleet-chart", aria: { label: chart.title } },
    el("h3", { textContent: `${chart.title}${unit}` }),
    plot,
    el("div", { class: "fleet-range" }, fields[0], "–", fields[1]),
  );
}

/** @param {HTMLElement} plot @param {number[]} edges @param {(range: Range) => void} onRange */
function dragging(plot, edges, onRange) {
  const bins = edges.length - 1;
  const binAt = (/** @type {PointerEvent} */ event) => {
    const box = plot.getBoundingClientRect();
    return Math.min(bins - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * bins)));
  };
  /** @type {number|null} */
  let begun = null;
  const between = (/** @type {PointerEvent} */ event) => [begun ?? 0, binAt(event)].sort((a, b) => a - b);
  plot.addEventListener("pointerdown", (event) => {
    begun = binAt(event);
    plot.setPointerCapture(event.pointerId);
  });
  plot.addEventListener("pointermove", (event) => {
    if (begun === null) return;
    const [first, last] = between(event);
    [...plot.children].forEach((bar, n) => {
      /** @type {HTMLElement} */ (bar).dataset.inside = String(n >= first && n <= last);
    });
  });
  plot.addEventListener("pointerup", (event) => {
    if (begun === null) return;
    const [first, last] = between(event);
    begun = null;
    onRange([rounded(edges[first]), rounded(edges[last + 1])]);
  });
  plot.addEventListener("pointercancel", () => (begun = null));
}

/** @param {number} value */
const rounded = (value) => Number(value.toPrecision(4));
/** @param {number} value */
const number = (value) => String(Number(value.toPrecision(3)));
