/** Which tracks the list shows, in which order, and which one comes next. */
import { memory } from "../../core/dom.js";
import { get } from "../../core/store.js";
import { present } from "./draft.js";
import { isAccepted } from "./labels.js";
import { isSure } from "./threshold.js";

/** @typedef {import("./types.js").LabelTrack} LabelTrack */
/** @typedef {"here"|"open"|"all"} Which */

/** @type {Which} */
let list = memory.read("labelTracks", "here");

/** Of this frame, to do, or all. */
export const which = () => list;

/** @param {Which} key */
export function listThe(key) {
  list = key;
  memory.write("labelTracks", key);
}

/** The tracks in the list. @returns {LabelTrack[]} */
export function listed() {
  const isListed = (/** @type {LabelTrack} */ track) => isSure(track) || track.id === get("track"),
    tracks = [...(get("labels")?.tracks.values() ?? [])].filter(isListed).sort((a, b) => a.id - b.id),
    here = new Set(present().map(({ track }) => track));
  if (list === "here") return tracks.filter(({ id }) => here.has(id));
  if (list === "open")
    return get("labeling")?.review ? tracks.filter(isUnreviewed) : tracks.filter(isOpen).sort(bySureness);
  return tracks;
}

/**
 * What is to do after a track, which may be done itself; after the last one, the first.
 * @param {LabelTrack} track @returns {LabelTrack|null}
 */
export function following(track) {
  const others = [...(get("labels")?.tracks.values() ?? [])]
    .filter((other) => other.id !== track.id && isOpen(other) && isSure(other))
    .sort(bySureness);
  return others.find((other) => bySureness(track, other) < 0) ?? others[0] ?? null;
}

/** Sent back first, then the surest proposals, then by number. @param {LabelTrack} a @param {LabelTrack} b */
const bySureness = (a, b) => rank(b) - rank(a) || a.id - b.id;
/** @param {LabelTrack} track */
const rank = ({ comment, confidence }) => (comment ? 2 : (confidence ?? 0));

/** @param {LabelTrack} track */
const isOpen = ({ state, comment }) => state === "proposed" || (Boolean(comment) && state !== "rejected");
/** @param {LabelTrack} label */
const isUnreviewed = (label) => isAccepted(label) && !label.reviewer;
