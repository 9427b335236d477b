/**
 * Name of the annotator. A user with a personal token has the account's name; others are asked once, and the
 * name is stored in this browser: click it to change it.
 */
import { request } from "../../core/api.js";
import { el, memory } from "../../core/dom.js";
import { set } from "../../core/store.js";
import { ask } from "../panels/dialogs.js";

/** @typedef {{name: string|null, role: "labeler"|"reviewer"|"admin"|null}} Account Without one, both are null. */

/** @type {Account} */
let account = { name: null, role: null };
/** @type {Promise<void>|null} */
let isLoading = null;
/** @type {Promise<string|null>|null} */
let asking = null;

export const setUp = () => void load();

/** An unreachable server is asked again with the next act. */
function load() {
  isLoading ??= request("api/account").then(
    (found) => {
      account = found;
      if (found.name) set("person", found.name);
    },
    () => {
      isLoading = null;
    },
  );
  return isLoading;
}

export const knownName = () => account.name ?? memory.read("person", "");

/** As shown: with the account's role. */
export const shownName = () => (account.name ? `${account.name} · ${account.role}` : knownName());
export const hasAccount = () => account.name !== null;
/** Approve labels, send them back, mark recordings as done. The server refuses it to others, too. */
export const mayReview = () => account.role !== "labeler";
/** Assign recordings to others. */
export const mayAssign = () => account.role === null || account.role === "admin";

/** The annotator's name, asked for if unknown; null if cancelled. @returns {Promise<string|null>} */
export async function personName() {
  await load();
  return knownName() || askName();
}

/** @returns {Promise<string|null>} */
export function askName() {
  asking ??= ask(
    "Your name",
    el("p", { class: "facts", textContent: "Stored with every label you make." }),
    "Name",
    knownName(),
    80,
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
