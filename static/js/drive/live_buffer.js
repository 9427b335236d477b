/**
 * Live sensors have no whole drive, so the timeline shows a ring buffer of the last minutes. The only events are marks,
 * which the server keeps.
 */
import { newestOnly, request } from "../core/api.js";
import { get, on, set } from "../core/store.js";

/** @typedef {import("./types.js").Columns} Columns */
/** @typedef {import("../core/types.js").Frame} Frame */
/** @typedef {import("./types.js").DriveEvent} DriveEvent */

/** Shown where a feature needs a recording. */
export const NO_DRIVE = "Not available with live sensors. Record a session, then open it.";

const MOST_FRAMES = 1200;
const SAME_S = 0.001;

/** @type {{[K in keyof Columns]: (frame: Frame) => Columns[K][number]}} */
const OF_FRAME = {
  cipv_id: ({ result }) => result.cipv?.id ?? null,
  source: (frame) => lead(frame)?.source ?? null,
  carried: (frame) => lead(frame)?.carried ?? null,
  distance_m: ({ result }) => result.cipv?.distance_m ?? null,
  closing_speed_mps: ({ result }) => result.cipv?.closing_speed_mps ?? null,
  ttc_s: ({ result }) => result.cipv?.ttc_s ?? null,
  path_offset_m: (frame) => lead(frame)?.path_offset_m ?? null,
  speed_mps: ({ result }) => result.ego?.speed_mps ?? null,
  desired_speed_mps: ({ result }) => result.acc?.desired_speed_mps ?? null,
  accel_mps2: ({ result }) => result.acc?.accel_mps2 ?? null,
  brake: ({ result }) => result.acc?.brake ?? null,
  acc_state: ({ result }) => result.acc?.state ?? null,
  next_cipv_id: ({ result }) => result.next_cipv?.id ?? null,
  objects: ({ result }) => result.objects.length,
  gaps: () => "",
  vl_disagreement_m: () => null,
  notes: ({ result }) => result.notes.length,
};
const NAMES = /** @type {(keyof Columns)[]} */ (Object.keys(OF_FRAME));

/** @type {string|null} */
let uri = null;
/** @type {number[]} */
let times = [];
let columns = empty();
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

/** @param {Frame} frame */
const lead = ({ result }) => result.objects.find(({ id }) => id === result.cipv?.id);

/** @returns {Columns} */
function empty() {
  return /** @type {any} */ (Object.fromEntries(NAMES.map((name) => [name, []])));
}

function remember() {
  const frame = get("frame");
  if (!frame?.state.live) return;
  if (frame.state.uri !== uri) {
    uri = frame.state.uri;
    times = [];
    columns = empty();
    marks = [];
  }
  if (frame.state.time_s === times.at(-1)) return;
  times.push(frame.state.time_s);
  for (const name of NAMES) /** @type {unknown[]} */ (columns[name]).push(OF_FRAME[name](frame));
  if (times.length > MOST_FRAMES) {
    times.shift();
    for (const name of NAMES) columns[name].shift();
  }
  for (const mark of marks) mark.index = placeOf(mark.t_s);
  set("drive", {
    uri,
    count: times.length,
    t_s: times,
    clips: [],
    now: { run: -1, done: times.length, columns },
    base: null,
    events: marks,
    comparison: null,
  });
}

/** The frame at a time; −Infinity if it was dropped. @param {number} t_s */
function placeOf(t_s) {
  return t_s < times[0] - SAME_S ? -Infinity : times.findLastIndex((time) => time <= t_s + SAME_S);
}
