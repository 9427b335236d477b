/** Histograms and counts of the Fleet view; clicking or dragging them sets a filter. */
import { el, press } from "../core/dom.js";
import { numberField, numberOf } from "../core/number_field.js";

/** @typedef {import("./filters.js").Range} Range */

/**
 * Kinds of event with their counts, and named conditions, as buttons.
 * @param {HTMLElement} parent
 * @param {{kinds: string[], named: Record<string, string>}} fleet
 * @param {{value: string|null, count: number}[]|null} counts of events; none: other tables have no kinds; null: unknown
 * @param {(kind: string) => void} onKind @param {(name: string) => void} onNamed
 * @param {{kinds: Set<string>, named: Set<string>}} chosen
 */
export function showKinds(parent, fleet, counts, onKind, onNamed, chosen) {
  const count = new Map(counts?.map(({ value, count }) => [value, count]));
  const kinds = fleet.kinds.filter((kind) => count.has(kind) || chosen.kinds.has(kind));
  const buttons = kinds.map((kind) => {
    const words = kind.replaceAll("_", " "),
      known = counts ? ` ${(count.get(kind) ?? 0).toLocaleString("en")}` : "";
    return chip(words + known, chosen.kinds.has(kind), "", () => onKind(kind));
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
 * A histogram of a column and the fields of its range. box: its element. fill: shows what was found. clear: removes the
 * bars, while they are unknown. refresh: shows the chosen range; not in a field that the user is typing in.
 * @typedef {object} Histogram
 * @property {HTMLElement} box
 * @property {(found: {edges: number[], counts: number[]}) => void} fill
 * @property {() => void} clear
 * @property {() => void} refresh
 */

/**
 * A histogram that is filled, and filled again, while it stays: what is typed in its fields meanwhile is not lost.
 * Dragging over bars, or filling in the fields below, sets a range.
 * @param {import("./filters.js").Chart} chart
 * @param {() => Range} chosen the range that is chosen now
 * @param {(range: Range) => void} onRange
 * @returns {Histogram}
 */
export function histogram(chart, chosen, onRange) {
  const bars = el("div", { class: "fleet-bars" });
  /** @type {number[]} */
  let edges = [];
  dragging(bars, () => edges, onRange);
  const fields = ["from", "to"].map((word, place) => {
    const field = numberField({ label: `${chart.title} ${word}` });
    field.addEventListener("change", () => {
      /** @type {Range} */
      const range = [...chosen()];
      range[place] = numberOf(field);
      onRange(range);
    });
    return field;
  });
  function refresh() {
    const range = chosen();
    fields.forEach((field, place) => {
      if (field !== document.activeElement) field.value = range[place] === null ? "" : String(range[place]);
    });
  }
  refresh();
  /** @param {number[]} found */
  function setEdges(found) {
    edges = found;
    fields.forEach((field, place) => {
      field.placeholder = edges.length ? number(edges[place ? edges.length - 1 : 0], edges) : "";
    });
  }
  const unit = chart.unit ? ` (${chart.unit})` : "";
  const box = el(
    "section",
    { class: "fleet-chart", aria: { label: chart.title } },
    el("h3", { textContent: `${chart.title}${unit}` }),
    bars,
    el("div", { class: "fleet-range" }, fields[0], "–", fields[1]),
  );
  return {
    box,
    refresh,
    fill(found) {
      setEdges(found.edges);
      bars.replaceChildren(...barsOf(chart, found, chosen()));
      if (!found.counts.length) bars.append(el("span", { class: "facts", textContent: "no values" }));
    },
    clear() {
      setEdges([]);
      bars.replaceChildren();
    },
  };
}

/**
 * @param {import("./filters.js").Chart} chart @param {{edges: number[], counts: number[]}} found @param {Range} chosen
 */
function barsOf(chart, { edges, counts }, [low, high]) {
  const highest = Math.max(...counts, 1);
  const words = edges.map((edge) => number(edge, edges));
  return counts.map((count, n) =>
    el("i", {
      style: { "--part": `${(100 * count) / highest}%` },
      data: { inside: String((low === null || edges[n + 1] > low) && (high === null || edges[n] < high)) },
      title: `${words[n]} – ${words[n + 1]} ${chart.unit}: ${count.toLocaleString("en")}`,
    }),
  );
}

/** @param {HTMLElement} plot @param {() => number[]} edgesNow @param {(range: Range) => void} onRange */
function dragging(plot, edgesNow, onRange) {
  const binAt = (/** @type {PointerEvent} */ event) => {
    const box = plot.getBoundingClientRect(),
      bins = edgesNow().length - 1;
    return Math.min(bins - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * bins)));
  };
  /** @type {number|null} */
  let begun = null;
  const between = (/** @type {PointerEvent} */ event) => [begun ?? 0, binAt(event)].sort((a, b) => a - b);
  plot.addEventListener("pointerdown", (event) => {
    if (edgesNow().length < 2) return;
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
    const [first, last] = between(event),
      edges = edgesNow();
    begun = null;
    onRange([rounded(edges[first]), rounded(edges[last + 1])]);
  });
  plot.addEventListener("pointercancel", () => (begun = null));
}

/** @param {number} value */
const rounded = (value) => Number(value.toPrecision(4));
/**
 * A value in words, no finer than a thousandth of the range: 0.00000757 of 0–9.35 is 0.
 * @param {number} value @param {number[]} edges
 */
function number(value, edges) {
  const range = edges[edges.length - 1] - edges[0];
  return String(Math.abs(value) < range / 1000 ? 0 : Number(value.toPrecision(3)));
}
