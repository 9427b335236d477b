/** Divides the timeline's height, from the top: time axis, lanes of fixed height, growing lanes, scroll bar. */

/** @typedef {import("./lanes/registry.js").Lane} Lane */
/** @typedef {{top: number, height: number}} Row  CSS pixels */
/** @typedef {{axis: Row, lanes: {lane: Lane, row: Row}[], bar: Row}} Rows */

const AXIS_PX = 15,
  BAR_PX = 7,
  GAP_PX = 4;

/**
 * Lanes of height 0 are left out. Growing lanes share the remaining height; the last ones are left out if each would
 * get less than its minimum height.
 * @param {number} height
 * @param {Lane[]} lanes
 * @returns {Rows}
 */
export function shareOut(height, lanes) {
  let top = 0;
  /** @param {number} size @returns {Row} */
  const take = (size) => ({ top: (top += size) - size, height: size });
  const axis = take(AXIS_PX);
  const shown = lanes.filter((lane) => lane.height() > 0);
  const fixed = shown.filter(({ grows }) => !grows).map((lane) => ({ lane, row: take(lane.height()) }));
  const rest = height - top - BAR_PX - GAP_PX;
  const growing = fitting(
    shown.filter(({ grows }) => grows),
    rest,
  );
  top += GAP_PX;
  const size = growing.length ? rest / growing.length : 0;
  return {
    axis,
    lanes: [...fixed, ...growing.map((lane) => ({ lane, row: take(size) }))],
    bar: { top: height - BAR_PX, height: BAR_PX },
  };
}

/** As many of the first lanes as fit below each other. @param {Lane[]} lanes @param {number} room @returns {Lane[]} */
function fitting(lanes, room) {
  const least = Math.max(1, ...lanes.map((lane) => lane.height()));
  return lanes.slice(0, Math.max(0, Math.floor(room / least)));
}

/** The lane at a pixel row, and its position. @param {Rows} rows @param {number} y */
export const laneAt = (rows, y) => rows.lanes.find(({ row }) => y >= row.top && y < row.top + row.height) ?? null;
