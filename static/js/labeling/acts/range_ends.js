/**
 * Moving the ends of lead ranges, by dragging on the timeline or by key. Adjacent ranges share one end: moving it
 * extends one range into the other.
 */
import { seekTo } from "../../drive/seek.js";
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { shown } from "../state/labels.js";

/** @typedef {import("../state/types.js").LeadRange} LeadRange */
/**
 * `at`: a border between frames, as the number of the frame after it.
 * @typedef {{at: number, before: LeadRange|null, after: LeadRange|null}} End
 */
/** A range with its new ends. @typedef {{range: LeadRange, first: number, last: number}} Trimmed */

const GRAB_PX = 6;

/** @returns {Map<number, End>} by border */
function ends() {
  /** @type {Map<number, End>} */
  const found = new Map();
  const at = (/** @type {number} */ border) =>
    found.get(border) ?? found.set(border, { at: border, before: null, after: null }).get(border);
  for (const range of get("labels")?.leads ?? []) {
    if (range.state === "rejected") continue;
    Object.assign(/** @type {End} */ (at(range.first)), { after: range });
    Object.assign(/** @type {End} */ (at(range.last + 1)), { before: range });
  }
  return found;
}

/** @param {Iterable<End>} among @param {(end: End) => number} away @returns {End|null} */
const nearest = (among, away) =>
  [...among].reduce((/** @type {End|null} */ best, end) => (best && away(best) <= away(end) ? best : end), null);

/** The end that can be grabbed at a pixel column. Narrow ranges remain clickable in the middle.
 * @param {import("../../timeline/span.js").Span} span @param {number} x @returns {End|null} */
export function endAt(span, x) {
  const end = nearest(ends().values(), ({ at }) => Math.abs(span.x(at) - x));
  if (!end) return null;
  const inside = span.x(end.at) > x ? end.before : end.after;
  const width = inside ? (inside.last + 1 - inside.first) * span.perFrame : Infinity;
  return Math.abs(span.x(end.at) - x) <= Math.min(GRAB_PX, width / 4) ? end : null;
}

/**
 * The range after moving an end to another border; it keeps at least one frame.
 * @param {End} end
 * @param {number} to
 * @returns {Trimmed|null} null if nothing changes
 */
export function trimmed({ at, before, after }, to) {
  const range = after && (to < at || !before) ? after : before;
  if (!range || to === at) return null;
  if (range === after) return { range, first: Math.min(to, range.last), last: range.last };
  return { range, first: range.first, last: Math.max(to - 1, range.first) };
}

/**
 * A drag of an end, previewed on the timeline. Escape cancels it.
 * @param {import("../../timeline/span.js").Span} span
 * @param {End} end
 * @returns {import("../../timeline/pointer.js").Act}
 */
export function dragEnd(span, end) {
  /** @type {Trimmed|null} */
  let held = null;
  let isDropped = false;
  const along = (/** @type {number} */ x) => {
    isDropped ||= held !== null && get("trimmed") !== held;
    const to = span.border(x);
    if (isDropped || (!held && to === end.at)) return;
    const range = end.after ?? /** @type {LeadRange} */ (end.before);
    held = trimmed(end, to) ?? { range, first: range.first, last: range.last };
    set("trimmed", held);
    seekTo(held.range === end.after ? held.first : held.last);
  };
  const ended = (/** @type {boolean} */ isKept) => {
    if (!held || get("trimmed") !== held) return;
    if (isKept) keep(held);
    else set("trimmed", null);
  };
  return Object.assign(along, { ended });
}

/** Save the new range; the preview stays until the server answers. @param {Trimmed} held */
async function keep(held) {
  const { range, first, last } = held;
  set("trimmed", held);
  if (first !== range.first || last !== range.last)
    await act({ kind: "trim_lead", range: range.id, revision: range.revision, first, last });
  if (get("trimmed") === held) set("trimmed", null);
}

/**
 * Move the nearest start or end of a range to the current frame.
 * @param {"after"|"before"} side side of the border on which the range lies
 */
export function bringHere(side) {
  const to = side === "after" ? shown() : shown() + 1;
  const end = nearest(
    [...ends().values()].filter((each) => each[side]),
    ({ at }) => Math.abs(at - to),
  );
  if (!end) return set("said", "No lead ranges yet. Mark frames (I, O), then set the lead (C)");
  const held = trimmed(end, to);
  if (held) keep(held);
  else set("said", `The lead already ${side === "after" ? "starts" : "ends"} here`);
}
