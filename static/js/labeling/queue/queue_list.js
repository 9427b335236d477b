/** The queue: recordings to label, most valuable first, with who labels each, how far it is and what it took. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { get, on } from "../../core/store.js";
import { goToFirst } from "../acts/commands.js";
import { knownName, mayAssign, mayReview, personName } from "../state/person.js";
import * as projects from "./project_list.js";

/**
 * An entry of `/api/labels/queue`.
 * @typedef {{key: string, title: string, uri: string, frames: number, person: string, state: string, labelled: number,
 *   reviewed: number, proposals: number, asked: number, worth: number, project: string, open_proposals: number,
 *   unreviewed: number,
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
  on(["labels"], arrive);
}

/** As the server sent it last. @type {Work[]} */
let queue = [];
/** The recording that could not be marked as done, and why. @type {{key: string, words: string}|null} */
let undone = null;
/** Where to go in a recording that is being opened. @type {{key: string, what: "proposed"|"unreviewed"}|null} */
let awaited = null;

export const look = () =>
  attempt(async () => {
    undone = null;
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
    {
      aria: { label: `State of ${work.title}` },
      onchange: () => (state.value === "done" ? finish(work, false) : change(work, { state: state.value })),
    },
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
    ...(undone?.key === work.key ? [refusal(work, undone.words)] : []),
    el("p", { class: "facts", textContent: facts(work) }),
  );
}

/** Why a recording is not done, with presses that lead on. @param {Work} work @param {string} words */
function refusal(work, words) {
  const ways = el(
    "div",
    { class: "menu-row", hidden: work.open_proposals + work.unreviewed === 0 },
    el("button", { type: "button", textContent: "Go to the first", onclick: () => toFirst(work) }),
    el("button", {
      type: "button",
      textContent: "Mark as done anyway",
      hidden: !mayAssign() || !work.labelled || work.person === knownName(),
      onclick: () => finish(work, true),
    }),
  );
  return el("div", {}, el("p", { class: "params-error", aria: { role: "alert" }, textContent: words }), ways);
}

/** Mark a recording as done. @param {Work} work @param {boolean} anyway although labels are left to review */
async function finish(work, anyway) {
  const person = await personName();
  if (person === null) return look();
  undone = null;
  try {
    queue = await request("api/labels/queue", "POST", { person, drive: work.key, state: "done", anyway });
  } catch (error) {
    undone = { key: work.key, words: error instanceof Error ? error.message : String(error) };
    queue = await request("api/labels/queue").catch(() => queue);
  }
  show(queue);
  list.querySelector("[role=alert]")?.scrollIntoView({ block: "nearest" });
}

/** Go to the first open proposal, else to the first unreviewed label; opens the recording first. @param {Work} work */
function toFirst({ key, uri, open_proposals }) {
  awaited = { key, what: open_proposals ? "proposed" : "unreviewed" };
  if (get("labels")?.drive === key) return arrive();
  return attempt(() => request("api/source", "POST", { uri }));
}

/** Go to what is awaited, once its labels are known. */
function arrive() {
  const labels = get("labels");
  if (!awaited || labels?.drive !== awaited.key || labels.revision === 0) return;
  const { what } = awaited;
  awaited = null;
  void goToFirst(what);
}

/** @param {Work} work */
function facts({ frames, labelled, reviewed, open_proposals, unreviewed, asked, worth, efforts }) {
  const people = efforts.map(({ person, acts, active_s }) => {
    const perFrame = (acts / frames).toFixed(1);
    return `${person} ${count(acts, "change")} (${perFrame} a frame), ${Math.round(active_s / 60)} min`;
  });
  return [
    `${frames} frames, lead labelled in ${percent(labelled)}, ${percent(reviewed)} of tracks reviewed`,
    `${count(open_proposals, "proposal")}, ${count(unreviewed, "label")} not reviewed, ` +
      `${count(asked, "queued frame")}, priority ${worth.toFixed(2)}`,
    ...people,
  ].join(" · ");
}

/** @param {number} number @param {string} noun */
const count = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;

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
