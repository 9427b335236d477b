/**
 * Acts on their way to the server: one after the other, so that each is based on what the one before it left. What is
 * said to be saved is what the server has answered.
 */
import { Refused, request } from "../api.js";
import { get, on, set } from "../store.js";
import { choose } from "./conflict.js";
import * as data from "./data.js";
import { knownName, personName } from "./person.js";
import { refsOf, rebased } from "./refs.js";

/** @typedef {import("./types.js").Act} Act */
/** @typedef {import("./types.js").ActAnswer} ActAnswer */
/** at_ms: when the server last said that something is on disk; problem: why the next is not. @typedef {{state: "saved"|"saving"|"failed", at_ms: number|null, problem: string}} Saving */
/** @typedef {{act: Act, path: string, person: string, done: (answer: ActAnswer|null) => void}} Waiting */

/** @type {Waiting[]} the first is under way, or waits for the server to be reached */
const queue = [];
let busy = false;
/** When the server last answered that something is on disk. @type {number|null} */
let savedAt_ms = null;

export function setUp() {
  addEventListener("beforeunload", (event) => queue.length && event.preventDefault());
  on(["link"], () => get("link")?.status === "live" && queue.length && send());
}

/**
 * Do something to the labels. The answer, or null when it was refused or given up.
 * @param {Act} act @returns {Promise<ActAnswer|null>}
 */
export async function act(act) {
  const person = await personName();
  return person === null ? null : put(act, "api/labels/act", person);
}

/** The last act of this person taken back, or done again. Who has no name yet changed parameters alone. @param {"undo"|"redo"} direction */
export const move = (direction) => put({ kind: direction }, `api/labels/${direction}`, knownName());

/** @param {Act} act @param {string} path @param {string} person @returns {Promise<ActAnswer|null>} */
function put(act, path, person) {
  return new Promise((done) => {
    const last = queue.at(-1);
    if (last && queue.length > 1 && isSameShape(last.act, act)) {
      last.done(null); // another nudge of the same cuboid, before the one before it went out
      queue.pop();
    }
    queue.push({ act, path, person, done });
    send();
  });
}

/** @param {Act} a @param {Act} b */
const isSameShape = (a, b) => a.kind === "set_sighting" && b.kind === a.kind && a.track === b.track && a.frame === b.frame;

/** Send what waits; also once more what could not be sent. */
export async function send() {
  if (busy) return;
  busy = true;
  for (let next = queue[0]; next; next = queue[0]) {
    tell("saving");
    if (!(await one(next))) break;
    queue.shift();
  }
  busy = false;
}

/** Send one. @param {Waiting} waiting @returns {Promise<boolean>} whether nothing more is to be done about it */
async function one(waiting) {
  const { act, path, person, done } = waiting;
  try {
    /** @type {ActAnswer} */
    const answer = await request(path, "POST", path.endsWith("/act") ? { person, act } : { person });
    settle(act, answer);
    done(answer);
    return true;
  } catch (error) {
    if (!(error instanceof Refused) || error.status >= 500) {
      tell("failed", error instanceof Refused ? error.message : "the server cannot be reached");
      return false;
    }
    if (error.status === 409 && error.answer?.theirs) {
      data.look();
      const mine = await choose(act, error.message, error.answer.theirs);
      if (mine) {
        waiting.act = mine;
        return one(waiting);
      }
    }
    tell("saved");
    set("said", error.message);
    done(null);
    return true;
  }
}

/** @param {Saving["state"]} state */
const tell = (state, problem = "") => set("saving", { state, at_ms: savedAt_ms, problem });

/** What has only begun (proposals, imports) and what changed nothing is not said to be saved. @param {Act} act @param {ActAnswer} answer */
function settle(act, answer) {
  if (answer.act != null) savedAt_ms = Date.now();
  tell("saved");
  const how = { undo: "undone: ", redo: "done again: " }[act.kind] ?? "";
  set("said", how + [answer.what, answer.note].filter(Boolean).join(": "));
  if (!answer.changed) return;
  for (const later of queue.slice(1)) later.act = rebased(later.act, refsOf(act), answer.changed);
  data.accept(answer.changed);
}
