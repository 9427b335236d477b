/** The pane of pairs: what to press next, the pairs with their distances, and the fit. */
import { $, el, press, text } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { labelOf, withUnit } from "./parameter_values.js";
import { apply, clear, hasHistory, isPairing, pairs, remove, setKind, undo } from "./pairs.js";

/** @typedef {import("./pairs.js").Pair} Pair */
/** @typedef {import("./pairs.js").PairKind} PairKind */
/** @typedef {import("./types.js").PairsAnswer} PairsAnswer */

const kinds = [
  kindButton("point", "Point", "Pick single LiDAR points"),
  kindButton("cluster", "Cluster", "Pick a vehicle by its points, and the middle of its lower edge; counts less"),
];
const step = el("p", { class: "pair-step", aria: { role: "status" } });
const list = el("ol", { class: "pair-list" });
const outcome = el("p", { class: "facts" }),
  values = el("dl", {}),
  warnings = el("ul", { class: "warnings" });
const applyButton = el("button", {
  type: "button",
  class: "primary",
  textContent: "Apply",
  title: "Use the fitted alignment (can be undone)",
  onclick: apply,
});
const undoButton = el("button", {
  type: "button",
  textContent: "Undo pair",
  title: "Undo the last pair added or removed (Ctrl Z)",
  onclick: undo,
});
const clearButton = el("button", { type: "button", textContent: "Clear", title: "Remove all pairs", onclick: clear });

/** @param {HTMLElement} pane */
export function fill(pane) {
  pane.append(
    el("div", { class: "pane-bar" }, el("h2", { textContent: "Pairs" }), el("span", { class: "spacer" }), ...kinds),
    el("div", { class: "pair-top" }, step, el("div", { class: "row" }, applyButton, undoButton, clearButton)),
    el("div", { class: "pane-body scroll pair-body" }, outcome, values, warnings, list),
  );
  on(["pairs"], show);
}

/** @param {PairKind} kind @param {string} textContent @param {string} title */
function kindButton(kind, textContent, title) {
  return el("button", { type: "button", textContent, title, data: { kind }, onclick: () => setKind(kind) });
}

/** What to do next, in a sentence. */
export function nextStep() {
  const { picked, kind, said, list: all } = pairs();
  if (said) return said;
  if (picked) {
    return picked.kind === "cluster"
      ? `Object at ${distance(picked)} m. Now press the middle of its lower edge in the image. Esc: release.`
      : `Point at ${distance(picked)} m. Now press where it belongs in the image. Esc: release.`;
  }
  if (all.length) return `Press ${kind === "cluster" ? "a vehicle's LiDAR points" : "a LiDAR point"} for another pair.`;
  return kind === "cluster"
    ? "Press a vehicle's LiDAR points, then the middle of its lower edge."
    : "Press a LiDAR point, then the pixel where it belongs.";
}

function show() {
  const { isOn, kind, list: all, answer } = pairs();
  $("#pair-pane").hidden = !isOn;
  document.body.classList.toggle("is-pairing", isOn);
  if (!isPairing()) return;
  for (const button of kinds) press(button, button.dataset.kind === kind);
  text(step, nextStep());
  applyButton.disabled = !answer?.fit;
  undoButton.disabled = !hasHistory();
  clearButton.disabled = !all.length;
  text(outcome, answer?.text ?? "");
  const fit = answer?.fit;
  values.replaceChildren(...(fit ? Object.entries(fit.sigmas).flatMap((entry) => valueRow(fit.changes, entry)) : []));
  warnings.replaceChildren(...(fit?.warnings ?? []).map((textContent) => el("li", { textContent })));
  warnings.hidden = !fit?.warnings.length;
  list.replaceChildren(...all.map((pair, k) => row(pair, k, answer)));
}

/** @param {Record<string, number|string>} changes @param {[string, number]} entry name and sigma */
function valueRow(changes, [name, sigma]) {
  const value = withUnit(name, Number(changes[name]));
  return [
    el("dt", { textContent: labelOf(name) }),
    el("dd", { textContent: value }, el("small", { textContent: ` ± ${withUnit(name, sigma)}` })),
  ];
}

/** @param {Pair} pair @param {number} k @param {PairsAnswer|null} answer */
function row(pair, k, answer) {
  const isWrong = answer?.fit?.outliers.includes(k) ?? false;
  const isHere = pair.name === get("frame")?.result.frame;
  return el(
    "li",
    { data: { wrong: isWrong ? "yes" : "no" } },
    el("b", { textContent: String(k + 1) }),
    el("span", { textContent: `${distance(pair)} m${pair.kind === "cluster" ? " · cluster" : ""}` }),
    el("span", { class: "facts", textContent: isHere ? "" : pair.name, title: `Picked in frame ${pair.name}` }),
    el("span", {
      class: "off",
      textContent: offText(pair, k, answer),
      title: "Distance from its pixel, now and fitted",
    }),
    el("button", {
      type: "button",
      class: "quiet",
      textContent: "✕",
      title: "Remove this pair",
      aria: { label: `Remove pair ${k + 1}` },
      onclick: () => remove(pair),
    }),
  );
}

/** @param {Pair} pair @param {number} k @param {PairsAnswer|null} answer */
function offText({ pixel }, k, answer) {
  const off = (/** @type {[number, number]|null|undefined} */ at) =>
    at ? `${Math.hypot(at[0] - pixel[0], at[1] - pixel[1]).toFixed(1)} px` : null;
  const now = off(answer?.present[k]),
    fitted = off(answer?.fit?.fitted[k]);
  return [now ?? "–", fitted].filter(Boolean).join(" → ");
}

/** @param {{point: [number, number, number]}} pair */
const distance = ({ point: [x, y] }) => Math.hypot(x, y).toFixed(1);
