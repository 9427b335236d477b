/** Requests to the server. High-rate input (sliders) goes through `newestOnly`. */

/** Root of the server, whichever page this is. */
const ROOT = new URL("../../", import.meta.url);

/** A request that the server refused; the message is the server's. */
export class Refused extends Error {
  /** @param {number} status @param {any} answer */
  constructor(status, answer) {
    super(answer?.detail ?? `the server answered ${status}`);
    this.status = status;
    this.answer = answer;
  }
}

/**
 * Returns the server's JSON response. Throws `Refused`, or a TypeError if the server cannot be reached.
 * @param {string} path @param {string} [method] @param {unknown} [body] @returns {Promise<any>}
 */
export async function request(path, method = "GET", body = undefined) {
  /** @type {RequestInit} */
  const options = { method };
  if (body !== undefined) {
    options.headers = { "content-type": "application/json" };
    options.body = JSON.stringify(body);
  }
  const response = await fetch(new URL(path, ROOT), options);
  const answer = await response.json().catch(() => null);
  if (!response.ok) throw new Refused(response.status, answer);
  return answer;
}

/** @template T @param {T} _ @param {T} newer */
const newerOf = (_, newer) => newer;

/**
 * Limits requests to one at a time; of those made meanwhile, only the newest is sent.
 * @template T
 * @param {(body: T) => Promise<void>} send
 * @param {(waiting: T, newer: T) => T} merge  merges two waiting bodies
 */
export function newestOnly(send, merge = newerOf) {
  let busy = false,
    hasWaiting = false;
  /** @type {T|undefined} undefined is a valid body */
  let waiting;
  let idle = Promise.resolve();
  /** @param {T} body @returns {Promise<void>} */
  async function work(body) {
    try {
      await send(body);
    } finally {
      const next = /** @type {T} */ (waiting),
        goesOn = hasWaiting;
      waiting = undefined;
      hasWaiting = false;
      busy = goesOn;
      if (goesOn) await work(next);
    }
  }
  /** Resolves once this request, and those merged with it, were answered. @param {T} body */
  return function submit(body) {
    if (busy) {
      waiting = hasWaiting ? merge(/** @type {T} */ (waiting), body) : body;
      hasWaiting = true;
    } else {
      busy = true;
      idle = work(body);
    }
    return idle;
  };
}

/** @typedef {{playing?: boolean, seek?: number, step?: number, speed?: number, loop?: boolean}} PlaybackChange */

/** @param {PlaybackChange} waiting @param {PlaybackChange} newer */
const merged = (waiting, newer) => ({
  ...waiting,
  ...newer,
  ...(newer.step ? { step: (waiting.step ?? 0) + newer.step } : {}),
});

const shared = newestOnly(
  (/** @type {PlaybackChange} */ body) => request("api/playback", "POST", body).catch(() => {}),
  merged,
);

/** @type {(change: PlaybackChange) => boolean} */
let local = () => false;

/** Ask this first about each change of playback. @param {(change: PlaybackChange) => boolean} handles */
export function handlePlayback(handles) {
  local = handles;
}

/** Change playback: of this page, if it has a playhead of its own, else of all. @param {PlaybackChange} change */
export const playback = (change) => (local(change) ? Promise.resolve() : shared(change));
