/** Going to a frame. At most one seek is under way; of those asked for meanwhile the newest counts. */
import { request } from "../core/api.js";
import { get, on, set } from "../core/store.js";

/** A server that shows another frame instead (a new recording, the end of playing) must not block seeking. */
const PATIENCE_MS = 1000;

/** @type {number|null} */
let underWay = null;
/** @type {number|null} */
let waiting = null;
let patience = 0;

export function setUp() {
  on(["frame"], () => get("frame")?.state.index === underWay && arrived());
}

/** The frame that the timeline stands at: where a seek is going, else the shown one; of live sensors the newest. */
export function here() {
  const state = get("state");
  return state?.live ? Math.max(0, (get("drive")?.count ?? 1) - 1) : (get("scrub") ?? state?.index ?? 0);
}

/** @param {number} index beyond the ends is the first or last frame */
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
  request("api/playback", "POST", { seek: target }).catch(arrived);
}

function arrived() {
  clearTimeout(patience);
  const next = waiting;
  underWay = waiting = null;
  if (next !== null && next !== get("frame")?.state.index) ask(next);
  else set("scrub", null);
}
