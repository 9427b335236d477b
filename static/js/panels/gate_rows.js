/** Gate rows: name, value, limit, bar, and the parameter that sets the limit. */
import { el, mark, text } from "../core/dom.js";
import { DASH, num } from "../core/format.js";
import { reveal } from "./params.js";

/** @typedef {import("../core/types.js").Gate} Gate */
/**
 * @typedef {object} Kind
 * @property {string} label
 * @property {"least"|"most"|"flag"} test  passes if at least the limit, at most the limit, or true
 * @property {string} [unit]
 * @property {string} [param]  the parameter behind the limit
 */

/** @type {Record<string, Kind>} */
const KINDS = {
  iou: { label: "Box overlap (IoU)", test: "least", param: "fusion.min_iou" },
  range_sigmas: { label: "Range difference", test: "most", unit: "σ", param: "fusion.range_gate_sigmas" },
  cluster_hits: { label: "Detections of the cluster", test: "least", unit: "frames" },
  same_kind: { label: "Kind of the cluster's box", test: "flag", param: "fusion.keep_partners" },
  class_size: { label: "Length for class", test: "most", unit: "m", param: "fusion.size_gate" },
  free_road: { label: "LiDAR sees through it", test: "most", param: "existence.enabled" },
  own_returns: { label: "LiDAR returns of its own", test: "least", param: "existence.enabled" },
  images_without_box: {
    label: "Images without a box on it",
    test: "most",
    unit: "images",
    param: "existence.use_missing_boxes",
  },
  vehicle_class: { label: "Vehicle class", test: "flag" },
  distance_known: { label: "Distance known", test: "flag", unit: "m" },
  hits: { label: "Detections", test: "least", param: "cipv.confirm_hits" },
  seen: { label: "Detected in this frame", test: "flag", param: "cipv.carried_may_become_lead" },
  size: { label: "Vehicle size", test: "flag", unit: "m", param: "cipv.max_size_m" },
  ahead: { label: "Ahead of bumper", test: "least", unit: "m" },
  clears_path_s: { label: "Clears path before us", test: "most", unit: "s", param: "cipv.crossing_margin_s" },
  path_offset: { label: "Path offset", test: "most", unit: "m", param: "path.half_width_m" },
  path_sigma: { label: "Position uncertainty", test: "most", unit: "m", param: "cipv.max_sigma_m" },
  lead_probability: { label: "Lead probability", test: "least", param: "cipv.become_probability" },
};
/** Bar range relative to the larger of value and limit. */
const HEADROOM = 1.2;

/** @param {string} name @returns {Kind} */
export const kindOf = (name) => KINDS[name] ?? { label: name.replaceAll("_", " "), test: "flag" };

/** A number with its unit. @param {number|null} value @param {Kind} kind */
export const quantity = (value, { unit }) =>
  value === null ? DASH : `${num(value, digits(value))}${unit ? ` ${unit}` : ""}`;

/** @param {number} value */
const digits = (value) => (Number.isInteger(value) ? 0 : Math.abs(value) < 10 ? 2 : 1);

/** An empty row for a gate; `showGate` fills it. @param {Gate} gate */
export function gateRow({ name }) {
  const { label, param } = kindOf(name);
  const title = param ? `Limit set by ${param}; click to edit` : label;
  const row = el(
    "button",
    { type: "button", class: "gate", title, disabled: !param, onclick: () => param && reveal(param)?.focus() },
    el("i", { class: "sign" }),
    el("span", { class: "name", textContent: label }),
    el("span", { class: "number" }),
    el("span", { class: "bar" }, el("i"), el("b")),
  );
  return row;
}

/** @param {HTMLElement} row @param {Gate} gate */
export function showGate(row, gate) {
  const kind = kindOf(gate.name),
    [, , number, bar] = /** @type {HTMLElement[]} */ ([...row.children]);
  mark(row, "passed", gate.passed ? "yes" : "no");
  const sign = signOf(kind, gate);
  const limit = sign && gate.limit !== null ? ` ${sign} ${quantity(gate.limit, { ...kind, unit: "" })}` : "";
  text(
    number,
    kind.test === "flag" && (!kind.unit || gate.value === null)
      ? gate.passed
        ? "yes"
        : "no"
      : `${quantity(gate.value, kind)}${limit}`,
  );
  row.setAttribute("aria-label", `${kind.label}: ${number.textContent}, ${gate.passed ? "passed" : "failed"}`);
  const isMeasured = sign !== "";
  bar.classList.toggle("is-empty", !isMeasured);
  if (!isMeasured) return;
  const most = HEADROOM * Math.max(gate.value ?? 0, gate.limit ?? 0, 1e-9);
  bar.style.setProperty("--value", `${(100 * Math.max(0, gate.value ?? 0)) / most}%`);
  bar.style.setProperty("--limit", `${(100 * (gate.limit ?? 0)) / most}%`);
}

/** Comparison sign; a dash if the gate depends on more than value and limit. @param {Kind} kind @param {Gate} gate */
function signOf({ test }, { value, limit, passed }) {
  if (test === "flag" || value === null || limit === null) return ""; // without a value, the condition does not apply
  const holds = test === "least" ? value >= limit : value <= limit;
  if (holds !== passed) return "–";
  return { least: { true: "≥", false: "<" }, most: { true: "≤", false: ">" } }[test][
    /** @type {"true"|"false"} */ (String(holds))
  ];
}
