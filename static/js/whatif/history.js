/** Undo and redo of parameter changes. The history is the server's, so that all who watch share it. */
import { request } from "../api.js";
import { $ } from "../dom.js";
import { on, get, set } from "../store.js";

export function setUp() {
  $("#undo-button").addEventListener("click", undo);
  $("#redo-button").addEventListener("click", redo);
  on(["state"], reflect);
}

export const undo = () => move("undo");
export const redo = () => move("redo");

/** @param {"undo"|"redo"} direction */
function move(direction) {
  const state = get("state");
  if (direction === "undo" ? state?.can_undo : state?.can_redo) request(`api/params/${direction}`, "POST").then((answer) => set("params", answer), () => {});
}

function reflect() {
  const state = get("state");
  $("#undo-button", HTMLButtonElement).disabled = !state?.can_undo;
  $("#redo-button", HTMLButtonElement).disabled = !state?.can_redo;
}
