/**
 * A field for a number. In `type=number`, what a decimal comma does depends on the browser and its language: it is left
 * out as it is typed, so that 1,5 becomes 15, or the whole number is lost. Here a comma is a point.
 */
import { el } from "./dom.js";

/** Significant digits after a step, without rounding errors. */
const DIGITS = 12;

/**
 * Fires `change` when a number is typed or the field is emptied, and for each step by an arrow key. Anything else is
 * marked as it is typed, and then taken back.
 * @param {{label: string, least?: number, most?: number, step?: number}} limits of the arrow keys
 * @param {import("./dom.js").Props} [props]
 */
export function numberField({ label, least = -Infinity, most = Infinity, step = 1 }, props = {}) {
  const looks = { type: "text", inputMode: "decimal", autocomplete: "off", spellcheck: false };
  const field = el("input", { ...looks, ...props, aria: { label } });
  let before = "";
  const isNumber = () => !Number.isNaN(numberOf(field));
  const check = () => field.setAttribute("aria-invalid", String(!isNumber()));
  field.addEventListener("focus", () => (before = field.value));
  field.addEventListener("input", check);
  field.addEventListener("change", (event) => {
    if (isNumber()) field.value = String(numberOf(field) ?? "");
    else {
      field.value = before;
      event.stopImmediatePropagation();
    }
    before = field.value;
    check();
  });
  field.addEventListener("keydown", (event) => {
    const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!direction || !isNumber()) return;
    event.preventDefault();
    const next = (numberOf(field) ?? (Number(field.placeholder) || 0)) + direction * step;
    field.value = String(Number(Math.min(most, Math.max(least, next)).toPrecision(DIGITS)));
    field.dispatchEvent(new Event("change", { bubbles: true }));
  });
  return field;
}

/** What is typed there: null if nothing is, NaN if it is no number. @param {{value: string}} field */
export function numberOf({ value }) {
  const typed = value.trim().replace("−", "-").replace(",", ".");
  return typed === "" ? null : Number(typed);
}
