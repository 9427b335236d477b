/** One parameter: its name, its slider, number box, switch or choice, and a way back to the preset's value. */
import { el } from "./dom.js";
import { attachTooltip } from "./tooltip.js";

/** A slider of a number that is null by default spans this much around what the recording says. */
const AROUND = 2;

/**
 * @param {string} name dotted
 * @param {{key: string, help: string, kind: string, min?: number, max?: number, step?: number, unit?: string,
 *   choices?: string[], nullable: boolean}} param
 * @param {(value: any) => void} change
 */
export function control(name, param, change) {
  const id = `param-${name}`;
  const input = { boolean: toggle, choice: choices, number: slider, integer: slider }[param.kind](id, param, change);
  const auto = el("span", { class: "auto", textContent: "auto", hidden: true, title: "Taken from the recording's calibration" });
  const reset = el("button", { type: "button", class: "reset", textContent: "↺", title: "Back to the preset's value", aria: { label: `Reset ${words(param.key)}` } });
  const label = el("label", { htmlFor: id, textContent: words(param.key) });
  const head = el("div", { class: "head" }, label, auto, el("span", { class: "unit", textContent: param.unit ?? "" }), reset);
  if (param.kind === "boolean") head.append(input.node);
  const node = el("div", { class: "param", data: { param: name } }, head, param.kind === "boolean" ? null : input.node);
  attachTooltip(label, `${param.help}. ${name}`);
  let base = null;
  reset.addEventListener("click", () => change(base));
  return {
    node,
    help: param.help,
    /** @param {any} value @param {any} preset @param {number|null} effective what null stands for @param {boolean} idle */
    show(value, preset, effective, idle) {
      base = preset;
      node.classList.toggle("is-changed", value !== preset);
      node.classList.toggle("is-idle", idle);
      auto.hidden = value !== null;
      input.show(value, effective);
    },
  };
}

/** "min_score" → "min score", but a symbol like h_res stays one. The unit stands beside it. */
function words(key) {
  const bare = key.replace(/_(m|s|px|deg|mps|mps2|kmh)$/, "");
  return /^.(_|$)/.test(bare) ? bare : bare.replaceAll("_", " ");
}

function slider(id, param, change) {
  const range = el("input", { type: "range", id, step: param.step ?? "any", min: param.min, max: param.max });
  const box = el("input", { type: "number", step: param.step ?? "any", min: param.min, max: param.max, aria: { label: `${words(param.key)}, number` } });
  const read = (text) => (param.kind === "integer" ? Math.round(Number(text)) : Number(text));
  range.addEventListener("input", () => {
    box.value = range.value;
    fill(range);
    change(read(range.value));
  });
  box.addEventListener("change", () => {
    if (box.value !== "") change(Math.min(param.max, Math.max(param.min, read(box.value))));
    else if (param.nullable) change(null);
  });
  return {
    node: el("div", { class: "control" }, range, box),
    show(value, effective) {
      const now = value ?? effective;
      if (param.nullable && effective) {
        range.min = String(Math.max(param.min, Math.min(effective / AROUND, effective * AROUND)));
        range.max = String(Math.min(param.max, Math.max(effective / AROUND, effective * AROUND)));
      }
      range.disabled = now === null;
      if (document.activeElement !== range) range.value = String(now ?? param.min);
      if (document.activeElement !== box) box.value = value === null ? "" : String(value);
      box.placeholder = effective === null ? "unknown" : String(effective);
      fill(range);
    },
  };
}

function fill(range) {
  const share = (range.value - range.min) / (range.max - range.min || 1);
  range.style.setProperty("--fill", `${100 * share}%`);
}

function toggle(id, _, change) {
  const box = el("input", { type: "checkbox", id, onchange: () => change(box.checked) });
  return { node: box, show: (value) => (box.checked = value) };
}

function choices(id, param, change) {
  const buttons = param.choices.map((choice) => el("button", { type: "button", textContent: choice.replaceAll("_", " "), onclick: () => change(choice) }));
  const node = el("div", { class: "control single" }, el("div", { class: "choices", id, aria: { role: "group", label: words(param.key) } }, ...buttons));
  return { node, show: (value) => buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(param.choices[i] === value))) };
}
