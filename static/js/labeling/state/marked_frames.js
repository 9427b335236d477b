/** The frames that a lead is painted over: marked at their start and at their end, or by a drag along the ribbon. */
import { get, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { leadAt, shown, trackOf } from "./labels.js";

/**
 * `typed`: the first digits of a lead's number.
 * @typedef {{first: number|null, last: number|null, typed: string}} Marked
 */
/** @typedef {import("./types.js").Lead} Lead */

const NONE = { first: null, last: null, typed: "" };

/** @returns {Marked} */
const marked = () => get("marked") ?? NONE;

export function begin() {
  const { last } = marked();
  set("marked", { first: shown(), last: last !== null && last >= shown() ? last : null, typed: "" });
}

export function end() {
  const { first } = marked();
  set("marked", { first: first !== null && first <= shown() ? first : null, last: shown(), typed: "" });
  tellMarked();
}

/** What can be said of what is marked. */
export function tellMarked() {
  const { first, last } = span();
  set(
    "said",
    `Frames ${first + 1}–${last + 1} marked: set the lead (C or number), all labelled (Shift W), or tag (Frame tab)`,
  );
}

/** @param {number} first @param {number} last */
export function markAll(first, last) {
  set("marked", { first: Math.min(first, last), last: Math.max(first, last), typed: "" });
}

export function forget() {
  if (get("marked")) set("marked", null);
}

/**
 * What would be painted: what is marked, to the shown frame where its other end is not; else the shown frame alone.
 * @returns {{first: number, last: number}}
 */
export function span() {
  const { first, last } = marked(),
    ends = [first ?? shown(), last ?? shown()];
  return { first: Math.min(...ends), last: Math.max(...ends) };
}

/** Say who leads in the marked frames. @param {Lead} lead */
export const paint = (lead) => over((frames) => act({ kind: "set_lead", ...frames, lead }));

/**
 * Say who leads in the marked frames or in this one; who is proposed here, and nothing is marked: in the whole range.
 * @param {Lead} lead
 */
export function choose(lead) {
  const range = leadAt(shown()),
    isProposed = range?.lead === lead && range.state === "proposed";
  return isProposed && !get("marked") ? judge("accept") : paint(lead);
}

/** Say that nobody has said who leads there. */
export const clear = () => over((frames) => act({ kind: "clear_lead", ...frames }));

/**
 * Do something to the marked frames. The mark goes at once, so that the next act is not about it; what was refused
 * brings it back.
 * @template T
 * @param {(frames: {first: number, last: number}) => Promise<T>} what
 * @returns {Promise<T>}
 */
export async function over(what) {
  const held = get("marked"),
    frames = span();
  forget();
  const answer = await what(frames);
  if (!answer && held && !get("marked")) set("marked", held);
  return answer;
}

/**
 * A digit of the lead's number. It is taken as soon as no other track's number begins like it; Enter takes what is
 * typed.
 * @param {string} digit
 */
export function type(digit) {
  const typed = marked().typed + digit;
  if (typed === "0") return paint("none");
  const fitting = [...(get("labels")?.tracks.values() ?? [])].filter(
    ({ id, state }) => state !== "rejected" && String(id).startsWith(typed),
  );
  if (!fitting.length) return set("marked", { ...marked(), typed: "" });
  if (fitting.length === 1 && String(fitting[0].id) === typed) return paint(fitting[0].id);
  set("marked", { ...marked(), typed });
}

/** Take the number that is typed. @returns {boolean} whether one was */
export function enter() {
  const track = trackOf(Number(marked().typed));
  if (!marked().typed || !track) return false;
  paint(track.id);
  return true;
}

/** The lead here is right, or is not. @param {"accept"|"reject"} kind */
export function judge(kind) {
  const range = leadAt(shown());
  return range ? act({ kind, items: [{ kind: "lead", id: range.id, revision: range.revision }] }) : null;
}
