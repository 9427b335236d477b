/** Events as flags on the timeline, their names, and their severity as colour and shape. */
import { ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { seekTo } from "../../drive/seek.js";

/** @typedef {import("../../drive/types.js").DriveEvent} DriveEvent */

const SHAPE_PX = 8;
/** @type {Record<string, string>} */
const NAMES = {
  first_acquisition: "First acquisition",
  cipv_switch: "CIPV switch",
  cipv_lost: "CIPV lost",
  cut_in: "Cut-in",
  cut_out: "Cut-out",
  ttc_minimum: "TTC minimum",
  warning: "Warning",
  brake: "Brake",
  vl_disagreement: "V–L disagreement",
  sensor_gap: "Sensor gap",
  mark: "Mark",
};

/** @param {DriveEvent} event */
export const nameOf = ({ kind }) => NAMES[kind] ?? kind.replaceAll("_", " ");

/**
 * What an event means to the user, in words, colour and shape; a mark is the user's own.
 * @type {Record<DriveEvent["severity"]|"mark", {words: string, tint: () => string, outline: [number, number][]}>}
 */
const WEIGHTS = {
  info: { words: "information", tint: () => ui("dim"), outline: round(8) },
  notice: { words: "notice", tint: () => ui("accent"), outline: round(4) },
  warning: { words: "warning", tint: () => ui("warn"), outline: round(3) },
  alarm: {
    words: "alarm",
    tint: () => ui("danger"),
    outline: [[0, 0], [1, 0], [1, 1], [0, 1]],
  },
  mark: { words: "mark", tint: () => ui("text"), outline: [[0, 0], [1, 0.4], [0.2, 0.8], [0.2, 1], [0, 1]] },
};

/**
 * A regular polygon with a corner at the top, in a unit square.
 * @param {number} corners @returns {[number, number][]}
 */
function round(corners) {
  return Array.from({ length: corners }, (_, i) => {
    const turn = (2 * Math.PI * i) / corners;
    return [0.5 + Math.sin(turn) / 2, 0.5 - Math.cos(turn) / 2];
  });
}

/** @param {DriveEvent} event */
export const weightOf = ({ kind, severity }) => WEIGHTS[kind === "mark" ? "mark" : severity];

/** Its colour and shape as custom properties, the shape as a `clip-path`. @param {typeof WEIGHTS.info} weight */
export const styleOf = ({ tint, outline }) => ({
  "--flag": tint(),
  "--shape": `polygon(${outline.map(([x, y]) => `${Math.round(100 * x)}% ${Math.round(100 * y)}%`).join(", ")})`,
});

/** All weights, for a legend. */
export const weights = () => Object.values(WEIGHTS);

/** @type {import("./registry.js").Lane} */
export const flags = {
  key: "flags",
  height: () => 13,
  draw(ctx, { span, row: { top, height } }) {
    for (const event of get("drive")?.events ?? []) {
      const x = span.middle(event.index);
      if (!span.holds(x)) continue;
      const { tint, outline } = weightOf(event);
      ctx.fillStyle = tint();
      ctx.fillRect(x - 0.5, top, 1, height + 2);
      ctx.beginPath();
      for (const [u, v] of outline) ctx.lineTo(x + 1.5 + SHAPE_PX * u, top + 1 + SHAPE_PX * v);
      ctx.fill();
    }
  },
  click(span, x) {
    const event = flagAt(get("drive")?.events ?? [], span, x);
    if (event) seekTo(event.index);
  },
};

/**
 * The event whose flag is under a pixel column.
 * @param {DriveEvent[]} events
 * @param {import("../span.js").Span} span
 * @param {number} x
 */
function flagAt(events, span, x) {
  const REACH_PX = 9;
  const near = events
    .map((event) => ({ event, away: Math.abs(span.middle(event.index) + 3 - x) }))
    .filter(({ away }) => away <= REACH_PX);
  return near.sort((a, b) => a.away - b.away)[0]?.event ?? null;
}
