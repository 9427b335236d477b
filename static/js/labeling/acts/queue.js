/**
 * Queue of acts to the server. They are sent one at a time, each based on the result of the one before. Only what the
 * server confirmed counts as saved. Each act has a unique id, so that resending one whose answer was lost applies it
 * once.
 */
import { Refused, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { choose } from "./conflict.js";
import * as data from "../state/sync.js";
import { knownName, personName } from "../state/person.js";
import { rebased, rebasedOnKept } from "./revisions.js";
import { driveNow } from "../state/undo_state.js";

/** @typedef {import("../state/types.js").Act} Act */
/** @typedef {import("../state/types.js").ActAnswer} ActAnswer */
/**
 * at_ms: time of the last confirmed save; problem: why the next one failed.
 * @typedef {{state: "saved"|"saving"|"failed", at_ms: number|null, problem: string}} Saving
 */
/**
 * Request body. drive: null if labeling is unavailable.
 * @typedef {{person: string, drive: string|null, act_id: string, act?: Act}} Body
 */
/** @typedef {{act: Act, path: string, body: Body, done: (answer: ActAnswer|null) => void}} Waiting */

/** HTTP statuses of an unavailable server or proxy: the act may be resent. */
const AWAY = [502, 503, 504];

/** Acts over frames: they carry the revision of the labels that the page shows, as acts on tracks carry theirs. */
const OVER_FRAMES = ["set_lead", "clear_lead", "trim_lead", "set_path", "remove_path", "add_event", "tag"];

/** @type {Waiting[]} the first is in flight, or waits for the server */
const queue = [];
let busy = false;
/** Time of the last confirmed save. @type {number|null} */
let savedAt_ms = null;

export function setUp() {
  addEventListener("beforeunload", (event) => (busy || queue.length) && event.preventDefault());
  on(["link"], () => get("link")?.status === "live" && send());
}

/**
 * Apply an act to the labels. Returns the server's answer, or null if it was refused or discarded.
 * @param {Act} act @returns {Promise<ActAnswer|null>}
 */
export async function act(act) {
  const person = await personName();
  if (person === null) return null;
  const seen = OVER_FRAMES.includes(act.kind) ? { seen: get("labels")?.revision ?? 0 } : {};
  return put({ ...act, ...seen }, "api/labels/act", person);
}

/**
 * Undo or redo this person's last act. Without a name, only parameter changes can be undone.
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
      last.done(null); // supersedes an unsent change of the same cuboid
      queue.pop();
    }
    queue.push({ act, path, body: { person, drive, act_id: newId() }, done });
    send();
  });
}

/** A version 4 UUID. `randomUUID` is missing on plain HTTP pages from other hosts. @returns {string} */
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

/** Send waiting acts, including those that failed to send. */
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
      else await settle(next, /** @type {ActAnswer} */ (answer));
    }
  } finally {
    busy = false;
  }
}

/** Discard all unsaved acts and show the server's state. */
export function discard() {
  if (busy) return;
  for (const { done } of queue.splice(0)) done(null);
  tell("saved");
  data.look();
}

/**
 * Handle a refused act: on a conflict the user chooses a version, otherwise the reason is shown.
 * @param {Waiting} waiting
 * @param {Refused} refusal
 */
async function refused(waiting, refusal) {
  const { detail, item, theirs, revision } = refusal.answer ?? {};
  data.look(); // this page may be behind the server
  if (item) {
    const mine = await choose(waiting.act, detail, item, theirs, revision);
    if (mine) {
      // who kept theirs is not asked again for what was done after it
      for (const later of queue) later.act = rebasedOnKept(later.act, waiting.act, mine);
      return queue.unshift({ ...waiting, act: mine, body: { ...waiting.body, act_id: newId() } });
    }
  }
  tell("saved");
  set("said", refusal.message);
  waiting.done(null);
}

/** @param {Saving["state"]} state */
const tell = (state, problem = "") => set("saving", { state, at_ms: savedAt_ms, problem });

/**
 * Handle an answer. Background tasks (proposals, imports) and acts without effect do not count as saved. Whoever waits
 * for the act goes on when the page knows what it changed.
 * @param {Waiting} waiting
 * @param {ActAnswer} answer
 */
async function settle({ act, done }, answer) {
  if (answer.act != null) savedAt_ms = Date.now();
  tell("saved");
  const how = { undo: "undone: ", redo: "redone: " }[act.kind] ?? "";
  // a task reports its outcome itself, which may already have arrived
  if (!("task" in answer)) set("said", how + [answer.what, answer.note].filter(Boolean).join(": "));
  if (answer.changed) {
    for (const later of queue) later.act = rebased(later.act, act, answer);
    await data.accept(answer.changed);
  }
  done(answer);
}
