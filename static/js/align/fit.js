/**
 * Fit: the alignment from the whole recording. The server computes it in the background; the result is shown and
 * changes nothing until it is applied, as one step that can be undone.
 */
import { request } from "../core/api.js";
import { el, text } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { change } from "../panels/params.js";
import { save as saveVersion } from "./versions.js";

/** @typedef {import("../core/types.js").AlignmentFit} AlignmentFit */

const POLL_MS = 300;
const UNITS = [
  ["res_deg", " °/px", 5],
  ["_deg", "°", 2],
  ["_px", " px", 1],
  ["_m", " m", 2],
];

const button = el("button", {
  type: "button",
  textContent: "Fit",
  title: "Fit the alignment to the vehicles of the whole recording",
  onclick: begin,
});
const bar = el("progress", { max: 1, value: 0, aria: { label: "Fitting the alignment" } });
const cancel = el("button", { type: "button", textContent: "Cancel", onclick: dismiss });
const running = el("span", { class: "fitting", hidden: true }, bar, cancel);
const heading = el("b", {}),
  said = el("p", {}),
  values = el("dl", {}),
  warnings = el("ul", { class: "warnings" });
const apply = el("button", { type: "button", class: "primary", textContent: "Apply" });
const save = el("a", {
  class: "button",
  href: "api/alignment/fit.yaml",
  textContent: "Save YAML",
  title: "Parameters for `cipv run --params FILE`",
});
save.setAttribute("download", "cipv-alignment.yaml");
const buttons = el(
  "div",
  { class: "row" },
  apply,
  save,
  el("button", { type: "button", textContent: "Dismiss", onclick: dismiss }),
);
/** The result, below the bar. */
export const resultPanel = el(
  "section",
  { class: "fit-result", aria: { label: "Fitted alignment", role: "status" }, hidden: true },
  heading,
  values,
  said,
  warnings,
  buttons,
);
/** The button, and the progress while a fit runs. */
export const fitControl = el("span", { class: "fit-control" }, button, running);

let timer = 0;
/** @type {string|null|undefined} */
let known;

on(["state"], () => {
  const state = get("state");
  button.disabled = !state || state.live || !state.count;
  if (state && state.uri !== known) {
    known = state.uri;
    poll(); // a fit may be under way in another browser, or before this page was loaded
  }
});

function begin() {
  const model = get("params")?.values["alignment.model"] ?? "pinhole";
  request("api/alignment/fit", "POST", { model }).then(show, fail);
}

function dismiss() {
  request("api/alignment/fit", "DELETE").then(poll, poll);
}

function poll() {
  clearTimeout(timer);
  request("api/alignment/fit").then(show, () => {}); // the connection's state is shown elsewhere
}

/** @param {AlignmentFit} fit */
function show(fit) {
  clearTimeout(timer);
  const isRunning = fit.state === "waiting" || fit.state === "running";
  running.hidden = !isRunning;
  button.hidden = isRunning;
  bar.value = fit.progress;
  if (isRunning) timer = setTimeout(poll, POLL_MS);
  if (fit.state === "failed") return fail(new Error(fit.note));
  resultPanel.hidden = !fit.result;
  if (!fit.result) return;
  const { changes, sigmas, pairs, frames } = fit.result;
  text(heading, `Fitted to ${pairs} vehicles in ${frames} frames`);
  values.replaceChildren(
    ...Object.entries(sigmas).flatMap(([name, sigma]) => [
      el("dt", { textContent: label(name) }),
      el(
        "dd",
        { textContent: number(name, Number(changes[name])) },
        el("small", { textContent: ` ± ${number(name, sigma)}` }),
      ),
    ]),
  );
  text(said, fit.result.text);
  showWarnings(fit.result.warnings);
  buttons.hidden = false;
  apply.hidden = save.hidden = false;
  apply.onclick = async () => {
    change(/** @type {any} */ (changes), true);
    await saveVersion("Fit"); // while the server still has the fit, whose score belongs to it
    dismiss();
  };
}

/** @param {Error} problem */
function fail(problem) {
  running.hidden = true;
  button.hidden = false;
  text(heading, "No fit");
  values.replaceChildren();
  text(said, problem.message);
  showWarnings([]);
  apply.hidden = save.hidden = true;
  resultPanel.hidden = false;
}

/** @param {string[]} sentences */
function showWarnings(sentences) {
  warnings.hidden = !sentences.length;
  warnings.replaceChildren(...sentences.map((textContent) => el("li", { textContent })));
}

/** @param {string} name */
const label = (name) => name.replace("alignment.", "").replace(/_(deg|px|m)$/, "");

/** @param {string} name @param {number} value */
function number(name, value) {
  const [, unit, digits] = UNITS.find(([end]) => name.endsWith(String(end))) ?? ["", "", 3];
  return `${value.toFixed(Number(digits))}${unit}`;
}
