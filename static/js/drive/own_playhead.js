/**
 * This page's own playhead: other pages do not move it, and it does not move theirs. The server computes its frames,
 * but playback runs here, since the server plays for all pages. The rerun view is shared by all pages, so a page that
 * shows it follows the shared playhead and moves it to its own frame.
 */
import { handlePlayback, request } from "../core/api.js";
import { patchState, tell } from "../core/connection.js";
import { isReloaded, tabMemory } from "../core/dom.js";
import { get, on, set } from "../core/store.js";

/**
 * `since`: when playing began, at frame `from`.
 * @typedef {{index: number, uri: string|null, playing: boolean, speed: number, loop: boolean, from: number,
 *   since: number}} Own
 */
/** @typedef {import("../core/api.js").PlaybackChange} PlaybackChange */

/** @type {Own|null} null: follows the shared playhead */
let own = null;
let timer = 0;

export const isOwn = () => own !== null;

/** Whether the active tab is shared by all pages. */
export const isShared = () => get("layout")?.tab === "rerun";

export function setUp() {
  handlePlayback(changed);
  patchState((state) => (own ? { ...state, playing: own.playing, speed: own.speed, loop: own.loop } : state));
  on(["frame"], () => own?.playing && schedule());
  on(["state"], () => {
    const uri = get("state")?.uri ?? null;
    if (!own || own.uri === uri) return;
    own.uri = uri;
    go(0);
  });
}

/** Leave the shared playhead, at the displayed frame. */
export function begin() {
  const state = get("frame")?.state;
  if (own || !state || state.live) return;
  const index = keptIndex(state.uri) ?? state.index;
  own = { index, uri: state.uri, playing: false, speed: state.speed, loop: state.loop, from: 0, since: 0 };
  tabMemory.write("own", { uri: own.uri, index });
  tell("own", index);
  show();
}

/**
 * Follow the shared playhead again.
 * @param {boolean} bringsIt whether it comes to this page's frame, and stops unless this page plays
 */
export async function end(bringsIt) {
  if (!own) return;
  const { index, playing } = own;
  own = null;
  clearTimeout(timer);
  if (bringsIt) await request("api/playback", "POST", { seek: index, playing }).catch(() => {});
  if (!own) tell("own", null);
}

/** Go to a frame. @param {number} index @returns {boolean} false if the page is there already */
export function go(index) {
  if (!own || own.index === index) return false;
  own.index = index;
  tabMemory.write("own", { uri: own.uri, index });
  tell("own", index);
  return true;
}

let resumes = isReloaded();

/**
 * The frame of this tab before a reload; null without a reload, or if another recording is open.
 * @param {string|null} uri
 */
function keptIndex(uri) {
  const held = tabMemory.read("own", /** @type {{uri: string|null, index: number}|null} */ (null)),
    isKept = resumes && held?.uri === uri;
  resumes = false;
  return isKept && held ? held.index : null;
}

/** Change playback of this page alone. @param {PlaybackChange} change @returns {boolean} whether it has its own */
function changed({ playing, seek, step, speed, loop }) {
  if (!own) return false;
  const last = (get("state")?.count ?? 1) - 1,
    target = seek ?? (step ? own.index + step : null);
  own = { ...own, speed: speed ?? own.speed, loop: loop ?? own.loop, playing: playing ?? (own.playing && !step) };
  if (target !== null) go(Math.min(last, Math.max(0, target)));
  Object.assign(own, { from: own.index, since: performance.now() });
  show();
  if (own.playing) schedule();
  else clearTimeout(timer);
  return true;
}

/** Continue playback with the next frame that is due; late ones are skipped. */
function schedule() {
  const state = get("state");
  clearTimeout(timer);
  if (!own?.playing || !state?.rate_hz) return;
  const perFrame_ms = 1000 / (state.rate_hz * own.speed),
    next = own.index + 1;
  const due_ms = own.since + (next - own.from) * perFrame_ms - performance.now();
  timer = setTimeout(() => {
    if (!own?.playing) return;
    const due = own.from + Math.floor((performance.now() - own.since) / perFrame_ms),
      target = Math.max(next, due);
    if (target < state.count) return go(target);
    if (own.loop) changed({ seek: 0 });
    else changed({ playing: false });
  }, due_ms);
}

/** Put this page's own playhead into the state. */
function show() {
  const state = get("state");
  if (state && own) set("state", { ...state, playing: own.playing, speed: own.speed, loop: own.loop });
}
