/** Requests to the server. What moves fast (sliders) goes through `newestOnly`. */

/** @returns {Promise<any>} The answer; rejects with the server's own sentence. */
export async function request(path, method = "GET", body = undefined) {
  const headers = body === undefined ? {} : { "content-type": "application/json" };
  const response = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
  const answer = await response.json().catch(() => null);
  if (!response.ok) throw new Error(answer?.detail ?? `the server answered ${response.status}`);
  return answer;
}

/**
 * One request at a time; while it is under way only the newest of the next ones is kept.
 * @param {(body: any) => Promise<void>} send
 * @param {(waiting: any, newer: any) => any} merge  what to keep of two that wait
 */
export function newestOnly(send, merge = (_, newer) => newer) {
  let busy = false;
  let waiting;
  return async function submit(body) {
    if (busy) {
      waiting = waiting === undefined ? body : merge(waiting, body);
      return;
    }
    busy = true;
    try {
      await send(body);
    } finally {
      busy = false;
      const next = waiting;
      waiting = undefined;
      if (next !== undefined) submit(next);
    }
  };
}

const merged = (waiting, newer) => ({ ...waiting, ...newer, ...(newer.step ? { step: (waiting.step ?? 0) + newer.step } : {}) });

/** Change playback: {playing, seek, step, speed, loop}. */
export const playback = newestOnly((body) => request("api/playback", "POST", body).catch(() => {}), merged);
