/**
 * Live sensors have no whole drive, so the timeline shows a ring buffer of the last minutes. The only events are marks,
 * which the server keeps.
 */
import { newestOnly, request } from "../core/api.js";
import { get, on, set } from "../core/store.js";

/** @typedef {import("./types.js").DriveEvent} DriveEvent */

/** Shown where a feature needs a recording. */
export const NO_DRIVE = "Not available with live sensors. Record a session, then open it.";

const MOST_FRAMES = 1200;
const SAME_S = 0.001;

/** @type {string|null} */
let uri = null;
/** @type {number[]} */
let times = [];
/** @type {Record<string, unknown[]>} a key of `Columns` each */
let columns = {};
/**
 * @type {DriveEvent[]} replaced only when marks change; their index changes as old frames are dropped
 */
let marks = [];
let known = "";

const fetchMarks = newestOnly(async (/** @type {string} */ of) => {
  const answer = await request("api/drive/events").catch(() => null);
  if (answer === null) known = "";
  else if (of === known) marks = answer.events;
});

export function setUp() {
  on(["frame"], remember);
  on(["state"], followMarks);
}

function followMarks() {
  const state = get("state");
  if (!state?.live) return;
  const key = `${state.uri} ${state.drive.revision}`;
  if (key === known) return;
  known = key;
  fetchMarks(key);
}

function remember() {
  const frame = get("frame");
  if (!frame?.row) return;
  if (frame.state.uri !== uri) {
    uri = frame.state.uri;
    times = [];
    columns = {};
    marks = [];
  }
  if (frame.state.time_s === times.at(-1)) return;
  times.push(frame.state.time_s);
  for (const [name, value] of Object.entries(frame.row)) (columns[name] ??= []).push(value);
  if (times.length > MOST_FRAMES) {
    times.shift();
    for (const values of Object.values(columns)) values.shift();
  }
  for (const mark of marks) mark.index = placeOf(mark.t_s);
  set("drive", {
    uri,
    count: times.length,
    t_s: times,
    clips: [],
    now: { run: -1, done: times.length, columns: /** @type {any} */ (columns) },
    base: null,
    events: marks,
    comparison: null,
  });
}

/** The frame at a time; −Infinity if it was dropped. @param {number} t_s */
function placeOf(t_s) {
  return t_s < times[0] - SAME_S ? -Infinity : times.findLastIndex((time) => time <= t_s + SAME_S);
}
