/** The marked frames: by start and end, or by a drag on the timeline. */
import { get, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { leadAt, shown, trackOf } from "./labels.js";

/**
 * `typed`: digits of a lead's number typed so far.
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

/** Show what can be done with the marked frames. */
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
 * The frames that a command applies to: the marked ones, with the current frame as a missing end, else the current
 * frame.
 * @returns {{first: number, last: number}}
 */
export function span() {
  const { first, last } = marked(),
    ends = [first ?? shown(), last ?? shown()];
  return { first: Math.min(...ends), last: Math.max(...ends) };
}

/** Set the lead in the marked frames. @param {Lead} lead */
export const paint = (lead) => over((frames) => act({ kind: "set_lead", ...frames, lead }));

/**
 * Set the lead in the marked frames or in this one. If the lead is proposed and nothing is marked, accept its whole
 * range.
 * @param {Lead} lead
 */
export function choose(lead) {
  const range = leadAt(shown()),
    isProposed = range?.lead === lead && range.state === "proposed";
  return isProposed && !get("marked") ? judge("accept") : paint(lead);
}

/** Clear the lead label of the marked frames. */
export const clear = () => over((frames) => act({ kind: "clear_lead", ...frames }));

/**
 * Apply a command to the marked frames. The mark is cleared at once and restored if the command is refused.
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
 * Type a digit of the lead's number. It applies as soon as it is unambiguous; Enter confirms earlier.
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

/** Apply the typed number. @returns {boolean} whether one was */
export function enter() {
  const track = trackOf(Number(marked().typed));
  if (!marked().typed || !track) return false;
  paint(track.id);
  return true;
}

/** Accept or reject the lead range at this frame. @param {"accept"|"reject"} kind */
export function judge(kind) {
  const range = leadAt(shown());
  if (!range) return null;
  const done = act({ kind, items: [{ kind: "lead", id: range.id, revision: range.revision }] });
  if (kind === "accept") done.then((answer) => answer && selectProposed(range.lead));
  return done;
}

/** An accepted lead whose track is only proposed is selected: the next A accepts that too. @param {Lead} lead */
function selectProposed(lead) {
  const track = typeof lead === "number" ? trackOf(lead) : null;
  if (track?.state === "proposed" && trackOf(get("track") ?? -1)?.state !== "proposed") set("track", track.id);
}
