/** How the timeline's height is shared out, from the top: time axis, flags, labels while labeling, ribbon, the compared ribbon, curves. */
import { CURVES } from "./curves.js";

/** @typedef {{top: number, height: number}} Row */
/** @typedef {{axis: Row, flags: Row, labels: {leads: Row, track: Row, tags: Row[]}|null, ribbon: Row, base: Row|null, lanes: {curve: import("./curves.js").Curve, row: Row}[], bar: Row}} Rows */

const AXIS_PX = 15, FLAGS_PX = 13, RIBBON_PX = 16, LABELS_PX = 18, TRACK_PX = 9, TAG_PX = 13, BASE_PX = 12, BAR_PX = 7, LANE_PX = 20;
/** Room between the two ribbons, where their differences are marked. */
export const MARKS_PX = 5;

/** @param {number} height @param {boolean} isComparing @param {Set<string>} wanted keys of the curves @param {number|null} tags rows of them; null while not labeling @returns {Rows} */
export function shareOut(height, isComparing, wanted, tags) {
  let top = 0;
  /** @param {number} size @returns {Row} */
  const take = (size) => ({ top: (top += size) - size, height: size });
  const axis = take(AXIS_PX), flags = take(FLAGS_PX);
  const labels = tags === null ? null : { tags: Array.from({ length: tags }, () => take(TAG_PX)), leads: take(LABELS_PX), track: take(TRACK_PX) }, ribbon = take(RIBBON_PX);
  if (isComparing) take(MARKS_PX);
  const base = isComparing ? take(BASE_PX) : null;
  const rest = height - top - BAR_PX - 4;
  const curves = CURVES.filter(({ key }) => wanted.has(key)).slice(0, Math.max(0, Math.floor(rest / LANE_PX)));
  top += 4;
  const size = curves.length ? rest / curves.length : 0;
  const lanes = curves.map((curve) => ({ curve, row: take(size) }));
  return { axis, flags, labels, ribbon, base, lanes, bar: { top: height - BAR_PX, height: BAR_PX } };
}
