/**
 * Acts on their way to the server: one after the other, so that each is based on what the one before it left. What is
 * said to be saved is what the server has answered. Each has an id of its own: one whose answer was lost is sent once
 * more, and done once.
 */
import { Refused, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { choose } from "./conflict.js";
import * as data from "../state/sync.js";
import { knownName, personName } from "../state/person.js";
import { rebased } from "./revisions.js";
import { driveNow } from "../state/undo_state.js";

/** @typedef {import("../state/types.js").Act} Act */
/** @typedef {import("../state/types.js").ActAnswer} ActAnswer */
/**
 * at_ms: when the server last said that something is on disk; problem: why the next is not.
 * @typedef {{state: "saved"|"saving"|"failed", at_ms: number|null, problem: string}} Saving
 */
/**
 * What is sent. drive: null where nothing can be labelled.
 * @typedef {{person: string, drive: string|null, act_id: string, act?: Act}} Body
 */
/** @typedef {{act: Act, path: string, body: Body, done: (answer: ActAnswer|null) => void}} Waiting */

/** Of a server that is not there now, or of what stands before it: it may be sent once more. */
const AWAY = [502, 503, 504];

/** @type {Waiting[]} the first is under way, or waits for the server to be reached */
const queue = [];
let busy = false;
/** When the server last answered that something is on disk. @type {number|null} */
let savedAt_ms = null;

export function setUp() {
  addEventListener("beforeunload", (event) => (busy || queue.length) && event.preventDefault());
  on(["link"], () => get("link")?.status === "live" && send());
}

/**
 * Do something to the labels. The answer, or null when it was refused or given up.
 * @param {Act} act @returns {Promise<ActAnswer|null>}
 */
export async function act(act) {
  const person = await personName();
  return person === null ? null : put(act, "api/labels/act", person);
}

/**
 * The last act of this person taken back, or done again. Who has no name yet changed parameters alone.
 * @param {"undo"|"redo"} direction
 */
export const move = (direction) => put({ kind: direction }, `api/labels/${direction}`, knownName());

/** @param {Act} act @param {string} path @param {string} person @returns {Promise<ActAnswer|null>} */
async function put(act, path, person) {
  const drive = await driveNow();
  if (drive === null && get("state")?.labels) {
    set("said", "Not saved: cannot reach the server");
    return null;
  }
  return new Promise((done) => {
    const last = queue.at(-1);
    if (last && queue.length > 1 && isSameShape(last.act, act)) {
      last.done(null); // another nudge of the same cuboid, before the one before it went out
      queue.pop();
    }
    queue.push({ act, path, body: { person, drive, act_id: newId() }, done });
    send();
  });
}

/** A UUID of version 4. A page that came over plain HTTP from another machine has no `randomUUID`. @returns {string} */
export function newId() {
  if (crypto.randomUUID) return crypto.randomUUID();
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  bytes[6] = (bytes[6] & 0x0f) | 0x40;
  bytes[8] = (bytes[8] & 0x3f) | 0x80;
  return [...bytes]
    .map((byte, i) => ([4, 6, 8, 10].includes(i) ? "-" : "") + byte.toString(16).padStart(2, "0"))
    .join("");
}

/** @param {Act} a @param {Act} b */
const isSameShape = (a, b) =>
  a.kind === "set_sighting" && b.kind === a.kind && a.track === b.track && a.frame === b.frame;

/** Send what waits; also once more what could not be sent. */
export async function send() {
  if (busy) return;
  busy = true;
  try {
    for (let next = queue[0]; next; next = queue[0]) {
      tell("saving");
      /** @type {ActAnswer|Error} */
      const answer = await request(
        next.path,
        "POST",
        next.path.endsWith("/act") ? { ...next.body, act: next.act } : next.body,
      ).catch((error) => error);
      const refusal = answer instanceof Refused && !AWAY.includes(answer.status) ? answer : null;
      if (answer instanceof Error && !refusal)
        return tell("failed", answer instanceof Refused ? answer.message : "cannot reach the server");
      queue.shift();
      if (refusal) await refused(next, refusal);
      else settle(next, /** @type {ActAnswer} */ (answer));
    }
  } finally {
    busy = false;
  }
}

/** Give up everything that is not saved; what the server has is shown again. */
export function discard() {
  if (busy) return;
  for (const { done } of queue.splice(0)) done(null);
  tell("saved");
  data.look();
}

/**
 * The server will not do it: of two people's changes the person here chooses, of all else it is said why.
 * @param {Waiting} waiting
 * @param {Refused} refusal
 */
async function refused(waiting, refusal) {
  const { detail, item, theirs } = refusal.answer ?? {};
  data.look(); // this page may have been behind, or the server half way through
  if (item && theirs) {
    const mine = await choose(waiting.act, detail, item, theirs);
    if (mine) return queue.unshift({ ...waiting, act: mine, body: { ...waiting.body, act_id: newId() } });
  }
  tell("saved");
  set("said", refusal.message);
  waiting.done(null);
}

/** @param {Saving["state"]} state */
const tell = (state, problem = "") => set("saving", { state, at_ms: savedAt_ms, problem });

/**
 * What has only begun (proposals, imports) and what changed nothing is not said to be saved.
 * @param {Waiting} waiting
 * @param {ActAnswer} answer
 */
function settle({ act, done }, answer) {
  if (answer.act != null) savedAt_ms = Date.now();
  tell("saved");
  const how = { undo: "undone: ", redo: "redone: " }[act.kind] ?? "";
  set("said", how + [answer.what, answer.note].filter(Boolean).join(": "));
  if (answer.changed) {
    for (const later of queue) later.act = rebased(later.act, act, answer);
    data.accept(answer.changed);
  }
  done(answer);
}
