/** Who labels. Asked once, kept in this browser, and changed by pressing the name. */
import { el, memory } from "../../core/dom.js";
import { set } from "../../core/store.js";
import { ask } from "../panels/dialogs.js";

/** @type {Promise<string|null>|null} */
let asking = null;

export const knownName = () => memory.read("person", "");

/** The person's name, asked for when it is not known; null when nobody wants to say. @returns {Promise<string|null>} */
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
