/** Two people label one recording independently: the second starts without labels; then both versions are compared. */
import { request } from "../../core/api.js";
import { el, text } from "../../core/dom.js";
import { percent } from "../../core/format.js";
import { seekTo } from "../../drive/seek.js";
import { get } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { personName } from "../state/person.js";
import * as dialogs from "./dialogs.js";

/** @typedef {import("../state/types.js").Version} Version */
/**
 * Response of `/api/labels/agreement`.
 * @typedef {{frames: number, lead_share: number|null, lead_disagreements: number[], vehicles: number,
 *   only_first: number, only_second: number, iou: number|null, class_share: number|null,
 *   reversed_share: number|null}} Agreement
 */

/** Name that the server gives the labels as they are now. */
const NOW = "working";
/** Frames listed; the rest are counted. */
const MOST = 100;

const first = el("select", { aria: { label: "First version" } }),
  second = el("select", { aria: { label: "Second version" } });
const result = el("div", { class: "agreement", aria: { role: "status" } });
const compared = el(
  "form",
  { onsubmit: compare },
  first,
  el("span", { class: "facts", textContent: "with" }),
  second,
  el("button", { textContent: "Compare" }),
);

/** @param {HTMLElement} parent */
export function setUp(parent) {
  parent.append(
    el("h3", { textContent: "Second labeler" }),
    el("button", {
      type: "button",
      textContent: "Freeze and start without labels",
      title: "Freeze these labels as a version and remove them, so that a second person labels independently",
      onclick: handOver,
    }),
    compared,
    result,
  );
}

/** @param {Version[]} versions */
export function show(versions) {
  compared.hidden = !versions.length;
  const chosen = [first.value, second.value],
    names = versions.map(({ name }) => name);
  const choice = (/** @type {string} */ name) =>
    el("option", { value: name, textContent: name === NOW ? "labels now" : name });
  first.replaceChildren(...names.map(choice));
  second.replaceChildren(...[...names, NOW].map(choice));
  first.value = names.includes(chosen[0]) ? chosen[0] : (names.at(-1) ?? "");
  second.value = names.includes(chosen[1]) ? chosen[1] : NOW;
}

/** @type {() => unknown} */
let again = () => undefined;

/** @param {() => unknown} listAgain after a version was frozen */
export const onFrozen = (listAgain) => (again = listAgain);

async function handOver() {
  const person = await personName(),
    revision = get("labels")?.revision ?? 0;
  if (person === null) return;
  const words = el("p", {
    textContent: "The labels are frozen under this name and removed. Undo brings them back.",
  });
  const name = await dialogs.ask("Freeze and start without labels", words, "Version name", person, 60);
  if (name === null) return;
  try {
    await request("api/labels/versions", "POST", { name, person });
    const answer = await act({ kind: "clear_all", revision });
    text(result, answer ? `Frozen as ${name}. The next person can label now, under another name.` : "");
  } catch (error) {
    text(result, /** @type {Error} */ (error).message);
  }
  again();
}

/** @param {Event} event */
async function compare(event) {
  event.preventDefault();
  const query = new URLSearchParams({ first: first.value, second: second.value });
  /** @type {Agreement|Error} */
  const found = await request(`api/labels/agreement?${query}`).catch((error) => error);
  if (found instanceof Error) return text(result, found.message);
  const shown = found.lead_disagreements.slice(0, MOST);
  result.replaceChildren(
    ...rows(found).map((words) => el("p", { class: "facts", textContent: words })),
    el("div", { class: "moment-buttons" }, ...shown.map(toFrame)),
    el("p", {
      class: "facts",
      hidden: shown.length === found.lead_disagreements.length,
      textContent: `the first ${MOST} of ${found.lead_disagreements.length}`,
    }),
  );
}

/** @param {Agreement} found */
function rows({ frames, lead_share, lead_disagreements, vehicles, only_first, only_second, ...of }) {
  const lead =
    lead_share === null
      ? "No frame has a lead label in both."
      : `Lead: same in ${percent(lead_share)} of ${frames} frames${lead_disagreements.length ? "; different in:" : ""}`;
  const cuboids =
    of.iou === null
      ? "No cuboid is in both."
      : `Cuboids: ${vehicles} in both, median IoU ${of.iou.toFixed(2)}, ` +
        `same class in ${percent(of.class_share ?? 0)}, ` +
        `reversed ${percent(of.reversed_share ?? 0)}`;
  const alone = `${only_first} only in ${first.value}, ${only_second} only in ${second.selectedOptions[0].text}`;
  return [`${cuboids}${of.iou === null ? "" : `; ${alone}`}`, lead];
}

/** @param {number} frame */
const toFrame = (frame) =>
  el("button", { type: "button", textContent: String(frame + 1), title: "Go to frame", onclick: () => seekTo(frame) });
