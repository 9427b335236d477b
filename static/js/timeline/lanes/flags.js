/** Events as flags on the timeline, and the names of event kinds. */
import { color, ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { seekTo } from "../../drive/seek.js";

/** @typedef {import("../../drive/types.js").DriveEvent} DriveEvent */

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

/** @param {DriveEvent} event the colour of its severity; marks have their own */
export function tintOf({ kind, severity }) {
  if (kind === "mark") return ui("accent");
  return { info: color("cipv"), notice: color("path"), warning: ui("warn"), alarm: ui("danger") }[severity];
}

/** @type {import("./registry.js").Lane} */
export const flags = {
  key: "flags",
  height: () => 13,
  draw(ctx, { span, row: { top, height } }) {
    for (const event of get("drive")?.events ?? []) {
      const x = span.middle(event.index);
      if (!span.holds(x)) continue;
      ctx.fillStyle = tintOf(event);
      ctx.fillRect(x - 0.5, top, 1, height + 2);
      ctx.beginPath();
      ctx.moveTo(x, top + 1);
      ctx.lineTo(x + 8, top + 4.5);
      ctx.lineTo(x, top + 8);
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
