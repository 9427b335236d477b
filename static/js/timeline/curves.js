/** Definitions of the timeline's curves, and their scaling and tracing. */
import { memory } from "../core/dom.js";
import { get } from "../core/store.js";
import { num, ttc } from "../core/format.js";
import { TTC_DANGER_S } from "../core/urgency.js";

/** @typedef {import("../drive/types.js").Columns} Columns */
/** @typedef {import("./span.js").Span} Span */
/** @typedef {{top: number, height: number}} Row */
/**
 * @typedef
 *   {{key: keyof Columns, unit: string, label: string, title: string, factor: number, low: number, high: number,
 *   most?: number, digits: number, words?: (value: number) => string, role: string, also?: keyof Columns, isArea?:
 *   boolean, limit?: number}}
 *   Curve
 */

/**
 * A pixel column of a line: its vertical extent, and its last value.
 * @typedef {{x: number, top: number, bottom: number, last: number}} Column
 */

/**
 * low and high: minimum range of the scale; most: values are clipped here; words: formatter, else fixed digits; also: a
 * second, fainter line.
 */
export const CURVES = /** @type {Curve[]} */ ([
  {
    key: "distance_m",
    label: "Distance",
    unit: "m",
    title: "Distance to the CIPV's nearest point",
    factor: 1,
    low: 0,
    high: 20,
    digits: 1,
    role: "cipv",
  },
  {
    key: "closing_speed_mps",
    label: "Closing",
    unit: "km/h",
    title: "Closing speed of the CIPV: positive while the gap shrinks",
    factor: 3.6,
    low: -5,
    high: 5,
    digits: 1,
    role: "cipv",
  },
  {
    key: "ttc_s",
    label: "TTC",
    unit: "s",
    title: `Time to collision with the CIPV, clipped at 15 s; dotted line: ${TTC_DANGER_S} s limit`,
    factor: 1,
    low: 0,
    high: 5,
    most: 15,
    digits: 1,
    words: ttc,
    role: "cipv",
    limit: TTC_DANGER_S,
  },
  {
    key: "path_offset_m",
    label: "Offset",
    unit: "m",
    title: "Lateral offset of the CIPV from the path centre; up is left",
    factor: 1,
    low: -1,
    high: 1,
    digits: 2,
    role: "cipv",
  },
  {
    key: "desired_speed_mps",
    label: "Desired",
    unit: "km/h",
    title: "ACC desired speed, with ego speed in grey",
    factor: 3.6,
    low: 0,
    high: 30,
    digits: 0,
    role: "path",
    also: "speed_mps",
  },
  {
    key: "brake",
    label: "Brake",
    unit: "%",
    title: "Brake command",
    factor: 100,
    low: 0,
    high: 100,
    digits: 0,
    role: "warning",
    isArea: true,
  },
]);

/** Keys of the curves that are shown; the browser remembers them. */
const shown = new Set(
  memory.read(
    "curves",
    CURVES.map(({ key }) => key),
  ),
);

/** @param {Curve} curve */
export const isShown = ({ key }) => shown.has(key);

/** Whether the drive has values for a curve, or may still get some. @param {Curve} curve */
export function hasData({ key, also }) {
  const drive = get("drive"),
    { now = null, base = null } = drive ?? {};
  if (!drive || !now || now.done < drive.count) return true;
  return [now, base].some((run) =>
    [key, also].some((name) => name && run?.columns[name].some((value) => value !== null)),
  );
}

/** Show a curve, or hide it. @param {Curve} curve */
export function toggleCurve({ key }) {
  if (!shown.delete(key)) shown.add(key);
  memory.write("curves", [...shown]);
}

/** Formatted value with its unit. @param {Curve} curve @param {number} value in the column's unit */
export const said = ({ factor, digits, unit, words }, value) =>
  `${words ? words(value * factor) : num(value * factor, digits)} ${unit}`;

/**
 * The scale that fits all values.
 * @param {Curve} curve @param {(number|null)[][]} lines in the columns' own unit @returns {{low: number, high: number}}
 */
export function scaleOf({ low, high, most, factor }, lines) {
  for (const line of lines) {
    for (const value of line) {
      if (value === null) continue;
      const shown = Math.min(most ?? Infinity, value * factor);
      if (shown < low) low = shown;
      if (shown > high) high = shown;
    }
  }
  return { low, high };
}

/**
 * Trace a line through known values, with breaks at unknown values and object changes. Frames that share a pixel column
 * are merged into their range, so that long drives draw as fast as short ones.
 * @param {CanvasRenderingContext2D} ctx
 * @param {(i: number) => number|null} value of the i-th sample, in the curve's unit
 * @param {{count: number, index: (i: number) => number, joined: (i: number) => boolean}} samples `joined`: sample i
 *   goes on from i − 1
 * @param {Span} span
 * @param {(value: number) => number} y
 */
export function traceLine(ctx, value, samples, span, y) {
  ctx.beginPath();
  /** @type {Column|null} */
  let column = null;
  let isAlone = false;
  const end = () => {
    if (column && column.bottom > column.top) {
      ctx.lineTo(column.x, column.top);
      ctx.lineTo(column.x, column.bottom);
      ctx.lineTo(column.x, column.last);
    } else if (column && isAlone) ctx.lineTo(column.x + 1, column.last);
    column = null;
  };
  for (let i = 0; i < samples.count; i++) {
    const index = samples.index(i),
      now = index < span.first - 1 || index > span.end ? null : value(i);
    if (now === null || !samples.joined(i)) {
      end();
      if (now === null) continue;
    }
    const x = Math.round(span.middle(index)),
      v = y(now);
    const open = /** @type {Column|null} */ (column);
    if (open?.x === x) {
      column = { x, top: Math.min(open.top, v), bottom: Math.max(open.bottom, v), last: v };
      continue;
    }
    isAlone = open === null;
    if (open) {
      end();
      ctx.lineTo(x, v);
    } else ctx.moveTo(x - 0.5, v);
    column = { x, top: v, bottom: v, last: v };
  }
  end();
}

/**
 * @param {Row} row
 * @param {{low: number, high: number}} scale
 * @param {number} [most]
 * @returns {(value: number) => number}
 */
export function yOf({ top, height }, { low, high }, most = Infinity) {
  const room = height - 6;
  return (value) => top + 3 + room - ((Math.min(value, most) - low) / (high - low || 1)) * room;
}
