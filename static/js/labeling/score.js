/** The present run against the labels: live after each act. */
import { newestOnly, request } from "../api.js";
import { el } from "../dom.js";
import { get, on } from "../store.js";
import { metricsTable } from "../whatif/metrics.js";

/** @typedef {import("./types.js").Score} Score */

/** @type {HTMLElement|null} */
let body = null;
let known = "";

export const look = newestOnly(async () => {
  const state = get("state"), key = `${state?.uri} ${state?.labels?.revision} ${state?.drive.run} ${state?.drive.done}`;
  if (!body || !isSeen() || !state?.labels || key === known) return;
  /** @type {Score|Error} */
  const score = await request("api/labels/score").catch((error) => error);
  known = score instanceof Error ? "" : key;
  body.replaceChildren(score instanceof Error ? el("p", { class: "facts pad", textContent: score.message }) : found(score));
});

const isSeen = () => get("labeling")?.on === true && body !== null && !body.hidden;

/** @param {HTMLElement} parent */
export function setUp(parent) {
  body = parent;
  on(["state", "labels"], () => isSeen() && look(undefined));
}

/** @param {Score} score */
function found(score) {
  if (!score.judged) return el("p", { class: "facts pad", textContent: "Nothing is accepted yet: accept tracks and leads, and the present run is judged against them." });
  return el("div", { class: "comparison" }, el("b", { textContent: "The present run against the labels" }), metricsTable({ ...score, truth: "labels" }));
}
