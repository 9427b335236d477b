/** Alignment parameters and time offsets as rows of name and value. */
import { el } from "../core/dom.js";
import { num } from "../core/format.js";

const UNITS = [
  ["res_deg", " °/px", 5],
  ["_deg", "°", 2],
  ["_px", " px", 1],
  ["_ms", " ms", 1],
  ["_m", " m", 2],
];

/** @param {string} name of an alignment parameter */
export const labelOf = (name) => name.replace("alignment.", "").replace(/_(deg|px|m)$/, "");

/** @param {string} name @param {number} value */
export function withUnit(name, value) {
  const [, unit, digits] = UNITS.find(([end]) => name.endsWith(String(end))) ?? ["", "", 3];
  return `${num(value, Number(digits))}${unit}`;
}

/** Terms and descriptions of a list. @param {Record<string, number|string>} changes */
export function valuesOf(changes) {
  return Object.entries(changes)
    .filter(([, value]) => typeof value === "number")
    .flatMap(([name, value]) => [
      el("dt", { textContent: labelOf(name) }),
      el("dd", { textContent: withUnit(name, Number(value)) }),
    ]);
}
