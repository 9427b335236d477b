/**
 * A fit to the whole recording: a button, its progress, and a panel with the result. The server computes it in the
 * background; the result changes nothing until it is applied, as one step that can be undone.
 */
import { request } from "../core/api.js";
import { el, text } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { change } from "../panels/params.js";
import { withUnit } from "./parameter_values.js";

const POLL_MS = 300;

/**
 * @typedef {object} Found
 * @property {Record<string, number|string>} changes
 * @property {Record<string, number>} sigmas
 * @property {string[]} warnings
 */

/**
 * @template {Found} Result
 * @typedef {object} FitKind
 * @property {string} button
 * @property {string} title
 * @property {string} running name of the progress bar
 * @property {string} panel name of the panel
 * @property {string} address of the API
 * @property {() => object} [asked] body of the request
 * @property {(found: Result) => string} heading
 * @property {(found: Result) => string} said
 * @property {(name: string) => string} label of a parameter
 * @property {HTMLElement} [more] another button for the result
 * @property {() => Promise<unknown>} [applied] called once the result is applied, while the server still has it
 */

/**
 * @template {Found} Result
 * @param {FitKind<Result>} kind
 * @returns {{control: HTMLElement, panel: HTMLElement}}
 */
export function fitJob(kind) {
  const button = el("button", { type: "button", textContent: kind.button, title: kind.title, onclick: begin });
  const bar = el("progress", { max: 1, value: 0, aria: { label: kind.running } });
  const cancel = el("button", { type: "button", textContent: "Cancel", onclick: dismiss });
  const running = el("span", { class: "fitting", hidden: true }, bar, cancel);
  const heading = el("b", {}),
    said = el("p", {}),
    values = el("dl", {}),
    warnings = el("ul", { class: "warnings" });
  const apply = el("button", { type: "button", class: "primary", textContent: "Apply" });
  const close = el("button", { type: "button", textContent: "Dismiss", onclick: dismiss });
  const buttons = el("div", { class: "row" }, apply, ...(kind.more ? [kind.more] : []), close);
  const panel = el(
    "section",
    { class: "fit-result", aria: { label: kind.panel, role: "status" }, hidden: true },
    heading,
    values,
    said,
    warnings,
    buttons,
  );
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
    request(kind.address, "POST", kind.asked?.()).then(show, fail);
  }

  function dismiss() {
    request(kind.address, "DELETE").then(poll, poll);
  }

  function poll() {
    clearTimeout(timer);
    request(kind.address).then(show, () => {}); // the connection's state is shown elsewhere
  }

  /** @param {import("../core/types.js").FitProgress & {result: Result|null}} fit */
  function show(fit) {
    clearTimeout(timer);
    const isRunning = fit.state === "waiting" || fit.state === "running";
    running.hidden = !isRunning;
    button.hidden = isRunning;
    bar.value = fit.progress;
    if (isRunning) timer = setTimeout(poll, POLL_MS);
    if (fit.state === "failed") return fail(new Error(fit.note));
    if (!fit.result) return void (panel.hidden = true);
    reveal();
    const { changes, sigmas } = fit.result;
    text(heading, kind.heading(fit.result));
    values.replaceChildren(
      ...Object.entries(sigmas).flatMap(([name, sigma]) => [
        el("dt", { textContent: kind.label(name) }),
        el(
          "dd",
          { textContent: withUnit(name, Number(changes[name])) },
          el("small", { textContent: ` ± ${withUnit(name, sigma)}` }),
        ),
      ]),
    );
    text(said, kind.said(fit.result));
    showWarnings(fit.result.warnings);
    apply.hidden = false;
    if (kind.more) kind.more.hidden = false;
    apply.onclick = async () => {
      change(/** @type {any} */ (changes), true);
      await kind.applied?.();
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
    apply.hidden = true;
    if (kind.more) kind.more.hidden = true;
    reveal();
  }

  /** Shown above the results of other fits. */
  function reveal() {
    if (panel.hidden) panel.parentElement?.prepend(panel);
    panel.hidden = false;
  }

  /** @param {string[]} sentences */
  function showWarnings(sentences) {
    warnings.hidden = !sentences.length;
    warnings.replaceChildren(...sentences.map((textContent) => el("li", { textContent })));
  }

  return { control: el("span", { class: "fit-control" }, button, running), panel };
}
