/** Score of the current run against the labels, updated after each act. */
import { newestOnly, request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { DASH, num, signed } from "../../core/format.js";
import { get, on } from "../../core/store.js";
import { metricsTable } from "../../panels/metrics_table.js";

/** @typedef {import("../state/types.js").Score} Score */

/** @type {HTMLElement|null} */
let body = null;
let known = "";

export const look = newestOnly(async () => {
  const state = get("state"),
    key = `${state?.uri} ${state?.labels?.revision} ${state?.drive.run} ${state?.drive.done}`;
  if (!body || !isSeen() || !state?.labels || key === known) return;
  if (!body.firstChild) body.append(el("p", { class: "facts pad", textContent: "Computing …" }));
  /** @type {Score|Error} */
  const score = await request("api/labels/score").catch((error) => error);
  known = score instanceof Error ? "" : key;
  body.dataset.revision = score instanceof Error ? "" : String(score.revision);
  body.replaceChildren(
    score instanceof Error ? el("p", { class: "facts pad", textContent: score.message }) : found(score),
  );
});

const isSeen = () => get("labeling")?.on === true && body !== null && !body.hidden;

/** @param {HTMLElement} parent */
export function setUp(parent) {
  body = parent;
  on(["state", "labels"], () => isSeen() && look(undefined));
}

/** @param {Score} score */
function found(score) {
  if (!score.metrics.length && !score.notes.length)
    return el("p", {
      class: "facts pad",
      textContent: "Nothing accepted yet. Accept tracks and leads to score the current run against them.",
    });
  const runs = get("state")?.drive,
    isAlone = !runs?.base || runs.base === runs.run;
  const notes = el("ul", { class: "notes" }, ...score.notes.map((words) => el("li", { textContent: words })));
  return el(
    "div",
    { class: "comparison" },
    el("b", { textContent: "Current run against labels" }),
    notes,
    score.metrics.length
      ? metricsTable({ ...score, truth: "labels" }, isAlone)
      : el("p", { class: "facts", textContent: "No frames can be scored yet." }),
    score.worst.length ? worstFrames(score.worst) : null,
    score.errors.length ? errorsTable(score.errors) : null,
  );
}

const VERDICTS = {
  correct: "correct lead",
  none: "correctly no lead",
  missed: "missed lead",
  false: "false lead",
  wrong: "wrong vehicle or distance",
};

/** @param {import("../state/types.js").BadFrame[]} worst */
function worstFrames(worst) {
  return el(
    "section",
    {},
    el("h3", { textContent: "Worst frames" }),
    el(
      "div",
      { class: "worst" },
      ...worst.map(({ frame, verdict, truth_m, error_m }) =>
        el(
          "button",
          {
            type: "button",
            class: "quiet",
            title: "Go to this frame",
            data: { frame, verdict },
            onclick: () => seekTo(frame),
          },
          el("b", { textContent: `${frame + 1}` }),
          el("span", { textContent: VERDICTS[verdict] }),
          el("span", { textContent: truth_m === null ? "" : `at ${num(truth_m)} m` }),
          el("span", { textContent: error_m === null ? "" : `${signed(error_m, 2)} m` }),
        ),
      ),
    ),
  );
}

const ERRORS = /** @type {const} */ (["distance", "lateral", "longitudinal", "speed"]);

/**
 * Table 4 of the paper: mean absolute error, with minimum and maximum below.
 * @param {import("../state/types.js").ScoreErrors[]} rows
 */
function errorsTable(rows) {
  const head = ["", "n", "distance", "lateral", "longit.", "speed"].map((words) =>
    el("th", { scope: "col", textContent: words }),
  );
  const body = rows.map((row) =>
    el(
      "tr",
      { data: { vehicles: row.vehicles, seen: row.seen_by } },
      el("th", { scope: "row", textContent: row.seen_by === "any" ? row.vehicles : row.seen_by }),
      el("td", { textContent: `${row.count}` }),
      ...ERRORS.map((name) => sizes(row[name])),
    ),
  );
  return el(
    "section",
    {},
    el("h3", { textContent: "Errors by distance and by sensor" }),
    el("table", { class: "metrics errors" }, el("thead", {}, el("tr", {}, ...head)), el("tbody", {}, ...body)),
    el("p", {
      class: "facts",
      textContent:
        "Per distance range: all vehicles, then by source (VL, V, L). Mean absolute error in m (speed: m/s), " +
        "with minimum–maximum below. Distance to the nearest point; lateral and longitudinal error at the centre " +
        "of the nearest face.",
    }),
  );
}

/** @param {import("../state/types.js").Sizes|null} found */
const sizes = (found) =>
  found
    ? el("td", {}, num(found.mae, 2), el("small", { textContent: `${num(found.min, 2)}–${num(found.max, 2)}` }))
    : el("td", { textContent: DASH });
