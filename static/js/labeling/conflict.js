/** Two people changed the same label: both versions side by side, and the person chooses. */
import { el } from "../dom.js";
import { open } from "./dialogs.js";
import { based, refsOf } from "./refs.js";

/** @typedef {import("./types.js").Act} Act */

/**
 * The act to send instead, based on what the other person left; null to let theirs stand.
 * @param {Act} act @param {string} sentence what the server says @param {any} theirs the item as it is now @returns {Promise<Act|null>}
 */
export function choose(act, sentence, theirs) {
  const body = el("div", {}, el("p", { textContent: sentence }),
    el("div", { class: "conflict" }, side("Yours", { ...act }), side("Theirs", theirs)));
  return open("Two people changed the same label", body, null, [
    ["Take theirs", null],
    ["Keep mine", () => based(act, (ref) => (isThat(act, ref, theirs) ? theirs.revision : ref.revision))],
  ]);
}

/** Of an act about several items, `theirs` is the one that has moved on. @param {Act} act @param {import("./types.js").ItemRef} ref @param {any} theirs */
const isThat = (act, ref, theirs) => ref.id === theirs.id || refsOf(act).length === 1;

/** @param {string} title @param {Record<string, any>} item */
function side(title, item) {
  const rows = Object.entries(item).filter(([key, value]) => !["sightings", "origin"].includes(key) && value !== null && value !== undefined && value !== "");
  return el("div", {}, el("h3", { textContent: title }), el("dl", { class: "facts-list" }, ...rows.flatMap(([key, value]) => [
    el("dt", { textContent: key.replaceAll("_", " ") }), el("dd", { textContent: words(value) })])));
}

/** @param {any} value @returns {string} */
function words(value) {
  if (typeof value === "number") return String(Math.round(value * 100) / 100);
  if (Array.isArray(value)) return value.length > 8 ? `${value.length} of them` : value.map(words).join(", ");
  if (value && typeof value === "object") return Object.entries(value).map(([key, inner]) => `${key.replace("_rad", "")} ${words(inner)}`).join(" · ");
  return String(value);
}
