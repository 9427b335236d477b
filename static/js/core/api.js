/** Requests to the server. What moves fast (sliders) goes through `newestOnly`. */

/** Every page of the server has the same root, wherever it lies itself. */
const ROOT = new URL("../../", import.meta.url);

/** What the server refused, in its own sentence. */
export class Refused extends Error {
  /** @param {number} status @param {any} answer */
  constructor(status, answer) {
    super(answer?.detail ?? `the server answered ${status}`);
    this.status = status;
    this.answer = answer;
  }
}

/**
 * The server's answer; rejects with `Refused`, or a TypeError when it could not be reached.
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
 * One request at a time; while it is under way only the newest of the next ones is kept.
 * @template T
 * @param {(body: T) => Promise<void>} send
 * @param {(waiting: T, newer: T) => T} merge  what to keep of two that wait
 */
export function newestOnly(send, merge = newerOf) {
  let busy = false,
    hasWaiting = false;
  /** @type {T|undefined} undefined is a body too */
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
  /** Settled once this and whatever waits with it was answered. @param {T} body */
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

/** Change playback. */
export const playback = newestOnly(
  (/** @type {PlaybackChange} */ body) => request("api/playback", "POST", body).catch(() => {}),
  merged,
);
