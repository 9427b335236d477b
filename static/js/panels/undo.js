/**
 * Undo and redo: one history of labels, parameters and calibration on the server, per person.
 */
import { $ } from "../core/dom.js";
import { move } from "../labeling/acts/queue.js";
import { isOn as isLabeling } from "../labeling/state/mode.js";
import { briefly } from "./notices.js";
import { settled } from "./params.js";
import { on, get } from "../core/store.js";

export function setUp() {
  $("#undo-button").addEventListener("click", undo);
  $("#redo-button").addEventListener("click", redo);
  on(["state", "steps", "params"], reflect);
}

/** Shortcuts are always sent, since this page may be outdated; the server reports if there is nothing to undo. */
export const undo = () => step("undo");
export const redo = () => step("redo");

/** @param {"undo"|"redo"} direction */
async function step(direction) {
  await settled(); // after pending changes
  const answer = await move(direction);
  if (answer === null && !isLabeling()) briefly(get("said") ?? ""); // the label pane says it by itself
}

/**
 * What this person can undo or redo: labels and parameters, or parameters alone if labeling is unavailable.
 */
export const possible = () => (get("state")?.labels ? get("steps") : get("params"));

function reflect() {
  $("#undo-button", HTMLButtonElement).disabled = !possible()?.can_undo;
  $("#redo-button", HTMLButtonElement).disabled = !possible()?.can_redo;
}
