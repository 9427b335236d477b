/** The filters of the Fleet view as an SQL condition. */
import { memory } from "../core/dom.js";

/** @typedef {"events"|"frames"|"objects"|"drives"} Table */
/** most: upper end of the histogram. @typedef {{column: string, title: string, unit: string, most?: number}} Chart */
/** Lower and upper end; null: open. @typedef {[number|null, number|null]} Range */

/** @param {string} column @param {string} title @param {string} unit @returns {Chart} */
const chart = (column, title, unit) => ({ column, title, unit });
/**
 * Longer TTCs are not shown: a vehicle that hardly approaches has one of minutes.
 * @param {string} column
 * @param {string} title
 */
const ttc = (column, title) => ({ ...chart(column, `${title}, up to 20`, "s"), most: 20 });
const SPEED = chart("speed_mps", "Ego speed", "m/s");
const DISTANCE = chart("distance_m", "Distance of the CIPV", "m");

/** The histograms of each table. @type {Record<Table, Chart[]>} */
export const CHARTS = {
  events: [ttc("min_ttc_s", "Shortest TTC"), DISTANCE, chart("max_gap_sigmas", "Camera − LiDAR", "σ"), SPEED],
  frames: [ttc("ttc_s", "TTC"), DISTANCE, chart("vl_gap_sigmas", "Camera − LiDAR", "σ"), SPEED],
  objects: [
    ttc("ttc_s", "TTC"),
    chart("distance_m", "Distance", "m"),
    chart("vl_gap_sigmas", "Camera − LiDAR", "σ"),
    chart("path_offset_m", "Offset from the path", "m"),
  ],
  drives: [
    chart("duration_s", "Duration", "s"),
    chart("mean_speed_mps", "Mean speed", "m/s"),
    chart("mean_lead_m", "Mean distance of the CIPV", "m"),
    chart("brightness", "Brightness", ""),
  ],
};

export const filters = {
  /** @type {Table} */
  of: memory.read("fleet.of", "events"),
  run: "",
  where: "",
  /** @type {Set<string>} any of these */
  kinds: new Set(),
  /** @type {Set<string>} all of these */
  named: new Set(),
  /** @type {Map<string, Range>} by column */
  ranges: new Map(),
  order: "",
  descending: false,
};

/** Columns differ between tables, so filters on them end when the table changes. @param {Table} of */
export function toggleTable(of) {
  if (of === filters.of) return;
  filters.of = of;
  filters.order = "";
  filters.kinds.clear();
  filters.named.clear();
  filters.ranges.clear();
}

/** @param {string} kind */
export const toggleKind = (kind) => toggle(filters.kinds, kind);
/** @param {string} name */
export const toggleNamed = (name) => toggle(filters.named, name);

/** @param {Set<string>} set @param {string} name */
function toggle(set, name) {
  if (!set.delete(name)) set.add(name);
}

/** @param {string} column @param {Range} range */
export function setRange(column, range) {
  if (range[0] === null && range[1] === null) filters.ranges.delete(column);
  else filters.ranges.set(column, range);
}

/**
 * @param {{kinds?: boolean, chart?: Chart}} without filters to leave out: those that a chart shows itself
 * @returns {string} SQL
 */
export function condition(without = {}) {
  const { column, most } = without.chart ?? {};
  const parts = filters.where.trim() ? [filters.where] : [];
  if (most !== undefined) parts.push(`${column} <= ${most}`);
  if (filters.kinds.size && !without.kinds) parts.push([...filters.kinds].join(" or "));
  parts.push(...filters.named);
  for (const [name, [low, high]] of filters.ranges) {
    if (name === column) continue;
    if (low !== null) parts.push(`${name} >= ${low}`);
    if (high !== null) parts.push(`${name} <= ${high}`);
  }
  // on a line of its own, so that a comment ends with it
  return parts.map((part) => `(\n${part}\n)`).join(" and ");
}
