/** The queue: recordings to label, most valuable first, with who labels each, how far it is and what it took. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { get } from "../../core/store.js";
import { knownName, mayAssign, mayReview, personName } from "../state/person.js";
import * as projects from "./project_list.js";

/**
 * An entry of `/api/labels/queue`.
 * @typedef {{key: string, title: string, uri: string, frames: number, person: string, state: string, labelled: number,
 *   reviewed: number, proposals: number, asked: number, worth: number, project: string,
 *   efforts: {person: string, acts: number, active_s: number}[]}} Work
 */

const STATES = ["open", "labeling", "review", "done"];

const list = el("div", { class: "queue", aria: { label: "Recordings to label" } });
const problem = el("p", { class: "params-error", aria: { role: "alert" } });

/** @param {HTMLElement} parent */
export function setUp(parent) {
  parent.append(el("h3", { textContent: "Recordings to label" }), problem);
  projects.setUp(parent, () => show(queue));
  parent.append(list);
}

/** As the server sent it last. @type {Work[]} */
let queue = [];

export const look = () =>
  attempt(async () => {
    await projects.look();
    show(await request("api/labels/queue"));
  });

/** @param {Work[]} found */
function show(found) {
  queue = found;
  list.replaceChildren(...queue.filter(({ project }) => projects.isShown(project)).map(row));
}

/** @param {Work} work */
function row(work) {
  const isOpen = get("labels")?.drive === work.key;
  const name = isOpen
    ? el("b", { textContent: work.title, title: "Open now" })
    : el("button", {
        type: "button",
        class: "quiet",
        textContent: work.title,
        title: `Open ${work.uri}`,
        onclick: () => attempt(() => request("api/source", "POST", { uri: work.uri })),
      });
  const state = el(
    "select",
    { aria: { label: `State of ${work.title}` }, onchange: () => change(work, { state: state.value }) },
    ...STATES.map((each) =>
      el("option", { value: each, textContent: each, disabled: each === "done" && !mayReview() }),
    ),
  );
  state.value = work.state;
  const take = el("button", {
    type: "button",
    textContent: work.person || "assign to me",
    title: work.person ? "Unassign" : "Label this recording",
    disabled: work.person !== "" && work.person !== knownName() && !mayAssign(),
    onclick: async () => change(work, { assign: work.person ? "" : await personName() }),
  });
  return el(
    "div",
    { class: "queue-row", data: { key: work.key } },
    name,
    el("div", { class: "menu-row" }, state, take),
    el("p", { class: "facts", textContent: facts(work) }),
  );
}

/** @param {Work} work */
function facts({ frames, labelled, reviewed, proposals, asked, worth, efforts }) {
  const people = efforts.map(({ person, acts, active_s }) => {
    const changes = `${acts} ${acts === 1 ? "change" : "changes"}`;
    return `${person} ${changes} (${(acts / frames).toFixed(1)} a frame), ${Math.round(active_s / 60)} min`;
  });
  return [
    `${frames} frames, lead labelled in ${percent(labelled)}, ${percent(reviewed)} of tracks reviewed`,
    `${proposals} proposals, ${asked} queued frames, priority ${worth.toFixed(2)}`,
    ...people,
  ].join(" · ");
}

/** @param {number} share */
const percent = (share) => `${Math.round(100 * share)} %`;

/** @param {Work} work @param {{assign?: string|null, state?: string}} to */
async function change(work, to) {
  const person = await personName();
  if (person === null) return look();
  const isDone = await attempt(async () =>
    show(await request("api/labels/queue", "POST", { person, drive: work.key, ...to })),
  );
  if (!isDone) request("api/labels/queue").then(show, () => {});
}

/** @param {() => Promise<unknown>} what @returns {Promise<boolean>} whether it succeeded */
async function attempt(what) {
  problem.textContent = "";
  return what().then(
    () => true,
    (error) => {
      problem.textContent = error.message;
      return false;
    },
  );
}
