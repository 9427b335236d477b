/**
 * Undo and redo: one history of labels, parameters and calibration. It is the server's; a person takes back their own.
 */
import { $ } from "../core/dom.js";
import { move } from "../labeling/acts/queue.js";
import { settled } from "./params.js";
import { on, get } from "../core/store.js";

export function setUp() {
  $("#undo-button").addEventListener("click", undo);
  $("#redo-button").addEventListener("click", redo);
  on(["state", "steps", "params"], reflect);
}

/** A key is not held back by what this page knows, which may be a moment old: the server says when there is nothing. */
export const undo = () => settled().then(() => move("undo")); // not before the change that it is to take back
export const redo = () => settled().then(() => move("redo"));

/**
 * What this person can take back or do again: of labels and parameters together, where the recording can be labelled.
 */
export const possible = () => (get("state")?.labels ? get("steps") : get("params"));

function reflect() {
  $("#undo-button", HTMLButtonElement).disabled = !possible()?.can_undo;
  $("#redo-button", HTMLButtonElement).disabled = !possible()?.can_redo;
}
