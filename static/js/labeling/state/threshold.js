/** How sure a proposal must be to be listed, drawn and accepted with others. Stored in this browser. */
import { memory } from "../../core/dom.js";
import { get, set } from "../../core/store.js";

/** @typedef {import("./types.js").LabelTrack} LabelTrack */

/** On the recordings at hand, no more than one vehicle in fifteen is below, and a third of what is none. */
const USUAL = 0.2;

/** @returns {number} 0–1 */
export const threshold = () => get("threshold") ?? memory.read("proposalThreshold", USUAL);

/** @param {number} value 0–1 */
export function setThreshold(value) {
  memory.write("proposalThreshold", value);
  set("threshold", value);
}

/** Whether a label is shown: nobody's proposal, or one that is sure enough. @param {LabelTrack} track */
export const isSure = (track) => !isJudged(track) || /** @type {number} */ (track.confidence) >= threshold();

/** Whether the threshold applies. @param {LabelTrack} track */
const isJudged = ({ state, comment, confidence }) => state === "proposed" && !comment && confidence !== null;

/** Proposals that the threshold leaves, and that it hides. @returns {{shown: LabelTrack[], hidden: LabelTrack[]}} */
export function parted() {
  const judged = [...(get("labels")?.tracks.values() ?? [])].filter(isJudged);
  return { shown: judged.filter(isSure), hidden: judged.filter((track) => !isSure(track)) };
}
