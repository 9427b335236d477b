/** A drag along a lane that marks frames. */
import { seekTo } from "../../drive/seek.js";
import { markAll, tellMarked } from "../state/marked_frames.js";

/**
 * @param {import("../../timeline/span.js").Span} span @param {number} from frame
 * @param {() => boolean} [use] called when the drag ends; returns false to leave the frames marked
 * @returns {import("../../timeline/pointer.js").Act}
 */
export function dragMarks(span, from, use = () => false) {
  let hasMoved = false;
  const along = (/** @type {number} */ x) => {
    const to = span.index(x);
    hasMoved ||= to !== from;
    if (hasMoved) markAll(from, to);
    seekTo(to);
  };
  const ended = (/** @type {boolean} */ isKept) => {
    if (isKept && hasMoved && !use()) tellMarked();
  };
  return Object.assign(along, { ended });
}
