/** Control of one parameter: name, input, and reset to the preset value. */
import { el, press } from "../core/dom.js";
import { numberField, numberOf } from "../core/number_field.js";
import { attachTooltip } from "../core/tooltip.js";

/** Slider range of a parameter that is null by default, relative to its effective value. */
const AROUND = 2;

/** @typedef {import("../core/types.js").Param} Param */
/** @typedef {import("../core/types.js").ParamValue} ParamValue */
/**
 * `isFinal` is false while a slider is being dragged.
 * @typedef {(value: ParamValue, isFinal: boolean) => void} Change
 */
/** @typedef {{node: HTMLElement, show: (value: any, effective: number|null) => void}} Input */

/**
 * @param {string} name dotted
 * @param {Param} param
 * @param {Change} change
 */
export function control(name, param, change) {
  const id = `param-${name}`;
  /** Last state from the server; empty after user input. */
  let shown = "";
  const moved = (/** @type {ParamValue} */ value, /** @type {boolean} */ isFinal) => {
    shown = "";
    change(value, isFinal);
  };
  const input = { boolean: toggle, choice: choices, number: slider, integer: slider }[param.kind](id, param, moved);
  const auto = el("span", {
    class: "auto",
    textContent: "auto",
    hidden: true,
    title: "Default from the recording's calibration or the detector",
  });
  const reset = el("button", {
    type: "button",
    class: "reset",
    textContent: "↺",
    title: "Reset to the preset value",
    aria: { label: `Reset ${words(param.key)}` },
  });
  const label = el("label", { htmlFor: id, textContent: words(param.key) });
  const head = el(
    "div",
    { class: "head" },
    label,
    auto,
    el("span", { class: "unit", textContent: param.unit ?? "" }),
    reset,
  );
  if (param.kind === "boolean") head.append(input.node);
  const node = el("div", { class: "param", data: { param: name } }, head, param.kind === "boolean" ? null : input.node);
  attachTooltip(label, `${param.help}. ${name}`);
  /** @type {ParamValue} */
  let base = null;
  reset.addEventListener("click", () => moved(base, true));
  return {
    node,
    help: param.help,
    /**
     * @param {ParamValue} value
     * @param {ParamValue} preset
     * @param {number|null} effective value used if null
     * @param {boolean} idle
     */
    show(value, preset, effective, idle) {
      base = preset;
      const now = JSON.stringify([value, preset, effective, idle]);
      if (now === shown) return;
      shown = node.contains(document.activeElement) ? "" : now; // do not overwrite a focused input
      node.classList.toggle("is-changed", value !== preset);
      node.classList.toggle("is-idle", idle);
      auto.hidden = value !== null;
      input.show(value, effective);
    },
  };
}

/** "min_score" → "min score", but a symbol like h_res stays one. The unit stands beside it. @param {string} key */
function words(key) {
  const bare = key.replace(/_(m|s|px|deg|mps|mps2|kmh)$/, "");
  return /^.(_|$)/.test(bare) ? bare : bare.replaceAll("_", " ");
}

/** @param {string} id @param {Param} param @param {Change} change @returns {Input} */
function slider(id, param, change) {
  const low = param.min ?? 0,
    high = param.max ?? 1,
    step = String(param.step ?? "any");
  const range = el("input", { type: "range", id, step, min: String(low), max: String(high) });
  const label = `${words(param.key)}, ${param.unit || "value"}`;
  const box = numberField({ label, least: low, most: high, step: param.step ?? (high - low) / 100 });
  const read = (/** @type {string|number} */ said) =>
    param.kind === "integer" ? Math.round(Number(said)) : Number(said);
  range.addEventListener("input", () => {
    box.value = range.value;
    fill(range);
    change(read(range.value), false);
  });
  range.addEventListener("change", () => change(read(range.value), true));
  box.addEventListener("change", () => {
    const typed = numberOf(box);
    if (typed !== null) change(Math.min(high, Math.max(low, read(typed))), true);
    else if (param.nullable) change(null, true);
  });
  return {
    node: el("div", { class: "control" }, range, box),
    show(value, effective) {
      const now = value ?? effective;
      if (param.nullable && effective) {
        range.min = String(Math.max(low, Math.min(effective / AROUND, effective * AROUND)));
        range.max = String(Math.min(high, Math.max(effective / AROUND, effective * AROUND)));
      }
      range.disabled = now === null;
      if (document.activeElement !== range) range.value = String(now ?? low);
      if (document.activeElement !== box) box.value = value === null ? "" : String(value);
      box.placeholder = effective === null ? "unknown" : String(effective);
      fill(range);
    },
  };
}

/** @param {HTMLInputElement} range */
function fill(range) {
  const low = Number(range.min),
    share = (Number(range.value) - low) / (Number(range.max) - low || 1);
  range.style.setProperty("--fill", `${100 * share}%`);
}

/** @param {string} id @param {Param} _ @param {Change} change @returns {Input} */
function toggle(id, _, change) {
  const box = el("input", { type: "checkbox", id });
  box.addEventListener("change", () => change(box.checked, true));
  return { node: box, show: (value) => (box.checked = value) };
}

/** @param {string} id @param {Param} param @param {Change} change @returns {Input} */
function choices(id, param, change) {
  const names = param.choices ?? [];
  const buttons = names.map((choice) =>
    el("button", { type: "button", textContent: choice.replaceAll("_", " "), onclick: () => change(choice, true) }),
  );
  const node = el(
    "div",
    { class: "control single" },
    el("div", { class: "choices", id, aria: { role: "group", label: words(param.key) } }, ...buttons),
  );
  return { node, show: (value) => buttons.forEach((button, i) => press(button, names[i] === value)) };
}
