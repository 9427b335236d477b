/** Frame tags: where each applies, and tagging the marked frames or the current one. */
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { over, span } from "../state/marked_frames.js";

/** @typedef {import("../state/types.js").FrameTag} FrameTag */

/** States that all vehicles in a frame are labelled (WHOLE_TAG in pipeline/labels/model.py). */
export const WHOLE_TAG = "all labelled";
/** Asks for labels of frames (NEXT_TAG in pipeline/labels/model.py). */
export const NEXT_TAG = "label next";
export const KNOWN_TAGS = [WHOLE_TAG, NEXT_TAG, "night", "rain", "snow", "fog", "glare", "sensor dirty", "tunnel"];

/** Add a tag to the marked frames, or remove it. @param {string} tag @param {boolean} isOn */
export const tagFrames = (tag, isOn) => over((frames) => act({ kind: "tag", ...frames, tag, on: isOn }));

/**
 * Toggle the fully-labelled tag of the marked frames. Warns about remaining proposals, since frames with proposals are
 * not scored.
 */
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

/** Remove a tag from the marked frames, or from its whole range. @param {FrameTag} range */
export function takeBack({ tag, first, last }) {
  if (get("marked")) return tagFrames(tag, false);
  return act({ kind: "tag", first, last, tag, on: false });
}

/** Whether all these frames have a tag. @param {string} tag @param {{first: number, last: number}} frames */
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

/** All tags in use: the one that scores need first, then by name. @returns {string[]} */
export function saidTags() {
  const words = [...new Set((get("labels")?.tags ?? []).map(({ tag }) => tag))].sort();
  return words.includes(WHOLE_TAG) ? [WHOLE_TAG, ...words.filter((word) => word !== WHOLE_TAG)] : words;
}
