/** Seeking. At most one seek is in flight; of those requested meanwhile, the newest wins. */
import { request } from "../core/api.js";
import { get, on, set } from "../core/store.js";
import { go, isOwn } from "./own_playhead.js";

/** Timeout, in case the server shows another frame instead (new recording, end of playback). */
const PATIENCE_MS = 1000;

/** @type {number|null} */
let underWay = null;
/** @type {number|null} */
let waiting = null;
let patience = 0;

export function setUp() {
  on(["frame"], () => get("frame")?.state.index === underWay && arrived());
}

/** The frame of the timeline cursor: the seek target, else the current frame; with live sensors the newest. */
export function here() {
  const state = get("state");
  return state?.live ? Math.max(0, (get("drive")?.count ?? 1) - 1) : (get("scrub") ?? state?.index ?? 0);
}

/** @param {number} index clamped to the drive */
export function seekTo(index) {
  const state = get("state"),
    count = state?.count ?? 0;
  if (!count || state?.live) return;
  const target = Math.min(count - 1, Math.max(0, Math.round(index)));
  set("scrub", target);
  if (underWay !== null) waiting = target;
  else ask(target);
}

/** @param {number} target */
function ask(target) {
  underWay = target;
  clearTimeout(patience);
  patience = setTimeout(arrived, PATIENCE_MS);
  if (isOwn()) return go(target) ? undefined : arrived();
  request("api/playback", "POST", { seek: target }).catch(arrived);
}

function arrived() {
  clearTimeout(patience);
  const next = waiting;
  underWay = waiting = null;
  if (next !== null && next !== get("frame")?.state.index) ask(next);
  else set("scrub", null);
}
