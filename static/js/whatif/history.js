/** Undo and redo: one history of labels, parameters and calibration. It is the server's; a person takes back their own. */
import { request } from "../api.js";
import { $ } from "../dom.js";
import { move as moveLabels } from "../labeling/acts.js";
import { on, get, set } from "../store.js";

export function setUp() {
  $("#undo-button").addEventListener("click", undo);
  $("#redo-button").addEventListener("click", redo);
  on(["state"], reflect);
}

export const undo = () => move("undo");
export const redo = () => move("redo");

/** What can be taken back or done again: of labels and parameters together, where the recording can be labelled. */
const can = () => get("state")?.labels ?? get("state");

/** @param {"undo"|"redo"} direction */
function move(direction) {
  if (!(direction === "undo" ? can()?.can_undo : can()?.can_redo)) return;
  if (get("state")?.labels) moveLabels(direction);
  else request(`api/params/${direction}`, "POST").then((answer) => set("params", answer), () => {});
}

function reflect() {
  $("#undo-button", HTMLButtonElement).disabled = !can()?.can_undo;
  $("#redo-button", HTMLButtonElement).disabled = !can()?.can_redo;
}
