/** Jumps between events, and between differences. */
import { get } from "../core/store.js";
import { here, seekTo } from "./seek.js";

/** @param {number[]} places ascending @param {number} from @param {1|-1} direction */
export function next(places, from, direction) {
  return direction > 0 ? places.find((at) => at > from) : places.findLast((at) => at < from);
}

/** @param {1|-1} direction */
export function toEvent(direction) {
  go(
    (get("drive")?.events ?? []).map(({ index }) => index),
    direction,
  );
}

/** Go to the start of a range in which the two runs differ. @param {1|-1} direction */
export function toDifference(direction) {
  go(
    (get("drive")?.comparison?.differing ?? []).map(([first]) => first),
    direction,
  );
}

/** @param {number[]} places @param {1|-1} direction */
function go(places, direction) {
  const at = next(places, here(), direction);
  if (at !== undefined) seekTo(at);
}
