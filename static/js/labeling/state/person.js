/** Name of the annotator. Asked once and stored in this browser; click the name to change it. */
import { el, memory } from "../../core/dom.js";
import { set } from "../../core/store.js";
import { ask } from "../panels/dialogs.js";

/** @type {Promise<string|null>|null} */
let asking = null;

export const knownName = () => memory.read("person", "");

/** The annotator's name, asked for if unknown; null if cancelled. @returns {Promise<string|null>} */
export async function personName() {
  return knownName() || askName();
}

/** @returns {Promise<string|null>} */
export function askName() {
  asking ??= ask(
    "Your name",
    el("p", { class: "facts", textContent: "Stored with every label you make." }),
    "Name",
    knownName(),
  ).then((name) => {
    asking = null;
    if (name) {
      memory.write("person", name);
      set("person", name);
    }
    return name;
  });
  return asking;
}
