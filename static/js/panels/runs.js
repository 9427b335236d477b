/** Runs of the whole drive with different parameters: keep, name, compare and delete; with the comparison on top. */
import { newestOnly, request } from "../core/api.js";
import { $, el, keyed, text } from "../core/dom.js";
import { toDifference } from "../drive/jumps.js";
import { NO_DRIVE } from "../drive/live_buffer.js";
import { get, on, paint, set } from "../core/store.js";
import { metricsTable } from "./metrics_table.js";

/** @typedef {import("../drive/types.js").Run} Run */

const list = el("div", { class: "run-list" }),
  comparison = el("div", { class: "comparison" });
const problem = el("p", { class: "params-error", aria: { role: "alert" }, hidden: true });
/** @type {{base: number|null, run: number|null, runs: Run[]}} */
let answer = { base: null, run: null, runs: [] };
let known = -1;

const refresh = newestOnly(async () => {
  answer = await request("api/runs").catch(() => answer);
  show();
});

export function setUp() {
  $("#runs").append(problem, comparison, list);
  for (const tab of ["params", "runs"]) $(`#tab-${tab}`).addEventListener("click", () => showTab(tab));
  on(["state"], () => {
    const revision = get("state")?.drive?.revision ?? -1;
    if (revision === known) return;
    known = revision;
    refresh(undefined);
  });
  paint(["drive"], showComparison);
}

/** @param {string} shown */
function showTab(shown) {
  for (const tab of ["params", "runs"]) {
    $(`#tab-${tab}`).setAttribute("aria-selected", String(tab === shown));
    $(`#${tab}`).hidden = tab !== shown;
  }
}

/** @param {string} path @param {string} [method] @param {unknown} [body] */
function act(path, method = "POST", body = undefined) {
  problem.hidden = true;
  return request(`api/runs/${path}`, method, body).then(
    (given) => {
      if (given?.values) set("params", given);
      refresh(undefined);
    },
    (error) => {
      problem.textContent = error.message;
      problem.hidden = false;
    },
  );
}

function show() {
  text($("#runs-count"), answer.runs.length > 1 ? String(answer.runs.length) : "");
  keyed(list, answer.runs, (run) => String(run.id), rowOf, showRun);
}

/** @param {Run} run */
function rowOf({ id }) {
  const name = el("input", { type: "text", class: "run-name", maxLength: 60, aria: { label: "Run name" } });
  name.addEventListener("change", () => act(`${id}/keep`, "POST", { name: name.value.trim() }));
  const yaml = el("a", {
    href: `api/runs/${id}/params.yaml`,
    textContent: "YAML",
    title: "YAML file for `cipv run --params`",
  });
  yaml.setAttribute("download", `cipv-run-${id}.yaml`);
  const button = (/** @type {string} */ words, /** @type {string} */ title, /** @type {() => void} */ onclick) =>
    el("button", { type: "button", textContent: words, title, onclick });
  return el(
    "div",
    { class: "run", data: { run: id } },
    el("div", { class: "run-top" }, name, el("span", { class: "tag" })),
    el("p", { class: "run-label" }),
    el(
      "div",
      { class: "run-buttons" },
      button("Keep", "Keep this run; unsaved runs are discarded", () =>
        act(`${id}/keep`, "POST", { name: name.value.trim() }),
      ),
      button("Use", "Use these parameters", () => act(`${id}/use`)),
      button("Compare", "Compare with this run", () => act(`${id}/base`)),
      yaml,
      el("span", { class: "facts" }),
      button("✕", "Delete run", () => act(String(id), "DELETE")),
    ),
  );
}

/** @param {HTMLElement} row @param {Run} run */
function showRun(row, run) {
  const name = $(".run-name", HTMLInputElement, row),
    isNow = run.id === answer.run,
    isBase = run.id === answer.base;
  if (document.activeElement !== name) name.value = run.name;
  name.placeholder = `Run ${run.id}`;
  row.classList.toggle("is-now", isNow);
  text(
    $(".tag", HTMLElement, row),
    [isNow ? "shown" : "", isBase ? "compared" : "", run.kept ? "kept" : ""].filter(Boolean).join(" · "),
  );
  text($(".run-label", HTMLElement, row), run.label || (Object.keys(run.changes).length ? "" : `preset ${run.preset}`));
  const [keep, use, base, drop] = [...row.querySelectorAll(".run-buttons button")].map(
    (button) => /** @type {HTMLButtonElement} */ (button),
  );
  keep.disabled = run.kept;
  use.disabled = isNow;
  base.disabled = isBase;
  drop.disabled = isNow || isBase;
  drop.setAttribute("aria-label", `Delete run ${run.name || run.id}`);
  text(
    $(".facts", HTMLElement, row),
    run.phase === "done"
      ? run.seconds === null
        ? ""
        : `${run.seconds.toFixed(run.seconds < 10 ? 1 : 0)} s`
      : run.note || `${Math.round((100 * run.done) / Math.max(1, run.total))}%`,
  );
}

/** Comparison of the current run with the base run. */
function showComparison() {
  const drive = get("drive"),
    found = drive?.comparison;
  if (!drive || !found) {
    return comparison.replaceChildren(
      el("p", {
        class: "facts pad",
        textContent: get("state")?.live
          ? NO_DRIVE
          : "Change a parameter to recompute the whole drive and compare the results here.",
      }),
    );
  }
  const sentences = Object.entries(found.first)
    .slice(0, 3)
    .map(([at, words]) => el("li", { textContent: `frame ${Number(at) + 1}: ${words}` }));
  comparison.replaceChildren(
    el(
      "div",
      { class: "run-top" },
      el("b", {
        textContent: found.frames_differing
          ? `${found.frames_differing} of ${drive.count} frames differ`
          : "No frames differ",
      }),
      el("span", { class: "spacer" }),
      el("button", {
        type: "button",
        textContent: "↑",
        title: "Previous difference (Shift X)",
        aria: { label: "Previous difference" },
        onclick: () => toDifference(-1),
      }),
      el("button", {
        type: "button",
        textContent: "↓",
        title: "Next difference (X)",
        aria: { label: "Next difference" },
        onclick: () => toDifference(1),
      }),
    ),
    el("ul", {}, ...sentences),
    metricsTable(found),
  );
}
