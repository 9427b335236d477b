/** Words about frames: where each is said, and saying it of the marked frames or of the shown one. */
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { over, span } from "../state/marked_frames.js";

/** @typedef {import("../state/types.js").FrameTag} FrameTag */

/** By this one a person says that every vehicle of frames is labelled (pipeline/labels/model.py, WHOLE_TAG). */
export const WHOLE_TAG = "all labelled";
export const KNOWN_TAGS = [WHOLE_TAG, "night", "rain", "snow", "fog", "glare", "sensor dirty", "tunnel"];

/** Say a word of the marked frames, or take it back there. @param {string} tag @param {boolean} isOn */
export const tagFrames = (tag, isOn) => over((frames) => act({ kind: "tag", ...frames, tag, on: isOn }));

/** Every vehicle of the marked frames is labelled; where that is said of all of them already, it is taken back. Scores
 * count no frame in which a vehicle is only proposed: that is said at once. */
export async function toggleWhole() {
  const frames = span(),
    isOn = !isSaid(WHOLE_TAG, frames);
  const answer = await tagFrames(WHOLE_TAG, isOn),
    left = isOn && answer ? proposedIn(frames) : 0;
  if (answer && left)
    set("said", `${answer.what}; ${left} ${left === 1 ? "track is" : "tracks are"} still proposed in these frames`);
}

/** @param {{first: number, last: number}} frames */
const proposedIn = (frames) =>
  [...(get("labels")?.tracks.values() ?? [])].filter(
    ({ state, first, last }) =>
      state === "proposed" && first !== null && last !== null && first <= frames.last && last >= frames.first,
  ).length;

/** Take a word back: in the marked frames, or wherever this range says it. @param {FrameTag} range */
export function takeBack({ tag, first, last }) {
  if (get("marked")) return tagFrames(tag, false);
  return act({ kind: "tag", first, last, tag, on: false });
}

/** Whether a word is said of all these frames. @param {string} tag @param {{first: number, last: number}} frames */
export function isSaid(tag, { first, last }) {
  let next = first;
  for (const range of rangesOf(tag).sort((a, b) => a.first - b.first))
    if (range.first <= next) next = Math.max(next, range.last + 1);
  return next > last;
}

/** @param {number} frame @returns {FrameTag[]} */
export const tagsAt = (frame) =>
  (get("labels")?.tags ?? []).filter(({ first, last }) => first <= frame && frame <= last);

/** @param {string} tag @returns {FrameTag[]} */
export const rangesOf = (tag) => (get("labels")?.tags ?? []).filter((range) => range.tag === tag);

/** Every word that is said somewhere: first what scores ask for, then the others by name. @returns {string[]} */
export function saidTags() {
  const words = [...new Set((get("labels")?.tags ?? []).map(({ tag }) => tag))].sort();
  return words.includes(WHOLE_TAG) ? [WHOLE_TAG, ...words.filter((word) => word !== WHOLE_TAG)] : words;
}
